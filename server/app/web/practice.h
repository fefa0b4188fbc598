#pragma once

// Practice alone (--practice): each visitor gets a session of their own from the hall of this
// machine, which says when there is no room for one more. Those who come then wait in a queue
// (practice_queue.h). Sessions that are over are ended at the hall, and so are all when this
// program ends; those that a killed one has left, where nobody is in them, at the next start.
//
// Thread: that of the I/O context. Bounds: one request to the hall at a time, besides those that
// end a session.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <memory>
#include <string>

#include "common/base/json.h"
#include "common/base/result.h"
#include "common/http/ask.h"
#include "server/app/web/options.h"
#include "server/watch/page/bridge.h"
#include "server/web/practice/practice_queue.h"

namespace trocar::app {

class Practice : public std::enable_shared_from_this<Practice> {
 public:
  // `bridge` outlives this. Error: the hall's key cannot be read.
  static Result<std::shared_ptr<Practice>> open(asio::io_context& context,
                                                const PracticeOptions& options,
                                                page::Bridge& bridge);
  void start();
  void stop();

  // Answers a page, as JSON: {"ticket", "state": "waiting", "number", "wait_s" or null} or
  // "starting";
  // {"state": "ready", "session", "code", "left_s"}; {"state": "over", "why"}; or {"state":
  // "full"}.
  std::string ask(const std::string& ticket, const std::string& address);
  const practice::PracticeQueue& queue() const { return queue_; }

 private:
  using Answer = Result<http::Answer>;

  Practice(asio::io_context& context, const PracticeOptions& options, std::string key,
           page::Bridge& bridge);
  asio::awaitable<void> run();
  asio::awaitable<Answer> ask_hall(std::string method, std::string path, std::string body);
  asio::awaitable<void> end_left_over();
  asio::awaitable<void> begin_one();
  asio::awaitable<void> await_session(std::string ticket, std::string name);
  void end_at_hall(const std::string& name);
  asio::awaitable<void> end_one(std::string name);
  practice::Use use_of(const std::string& session) const;
  void fail(const std::string& ticket, const std::string& name);

  asio::io_context& context_;
  const PracticeOptions options_;
  const std::string key_;
  page::Bridge& bridge_;
  practice::PracticeQueue queue_;
  asio::steady_timer timer_;
  double retry_at_s_ = 0;  // the hall had no room
  std::string told_;       // in the log, until it changes
  bool is_stopping_ = false;
};

}  // namespace trocar::app
