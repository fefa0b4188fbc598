#pragma once

// trocar-web beside a server (--browser): a child that serves the page for this one session, and
// ends with it. What it says goes to our standard errors. Thread: that which started it.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cstdint>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/process/process.h"
#include "server/app/server/options.h"

namespace trocar::app {

class BrowserPage {
 public:
  // Returns once the page is served, from then on its end is said in the log; null: nobody asks for
  // one. `port` is the session's. Error: there is no trocar-web, or it
  // has ended, such as where its port is taken; it has said why.
  static Result<std::unique_ptr<BrowserPage>> start(asio::io_context& context,
                                                    const ServerOptions& options,
                                                    std::uint16_t port);
  // Says whether start() would find what it needs.
  static Status check(const ServerOptions& options);

  // The links for people, a line each, and QR codes where somebody sits at a terminal.
  const std::string& links() const { return links_; }
  // Its people have heard of the session's end.
  void stop();

 private:
  BrowserPage(asio::io_context& context, process::Child child, std::string links)
      : child_(std::move(child)), links_(std::move(links)), timer_(context) {}

  // Says in the log if it ends by itself, until stop().
  void watch();

  process::Child child_;
  std::string links_;
  asio::steady_timer timer_;
};

}  // namespace trocar::app
