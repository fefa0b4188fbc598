// trocar-web: serves the page on which people watch sessions and recordings in a browser.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cmath>
#include <cstdio>

#include "common/base/log.h"
#include "common/base/signals.h"
#include "common/base/text_file.h"
#include "server/app/config/service.h"
#include "server/app/web/links.h"
#include "server/app/web/web_start.h"

namespace trocar::app {
namespace {

// Everybody is cut; a second later the program ends whatever is still there.
void end_in_order(asio::io_context& context, WebServer& server, asio::steady_timer& timer) {
  server.stop();
  timer.expires_after(std::chrono::seconds(1));
  timer.async_wait([&context](boost::system::error_code) { context.stop(); });
}

Status run_web(const WebOptions& options) {
  auto start = prepare_web(options);
  if (!start) return start.error();
  const auto key = start->content.recordings_key, practice_key = start->content.practice_key;
  asio::io_context context{1};
  auto listening =
      WebServer::listen(context, options, std::move(start->content), std::move(start->tls));
  if (!listening) return listening.error();
  auto& server = **listening;
  server.start();
  asio::signal_set signals(context);
  for (const int signal : ending_signals()) signals.add(signal);
  asio::steady_timer end(context), last(context);
  signals.async_wait([&](boost::system::error_code error, int) {
    if (!error) end_in_order(context, server, last);
  });
  if (options.seconds > 0) {
    end.expires_after(std::chrono::nanoseconds(std::llround(options.seconds * 1e9)));
    end.async_wait([&](boost::system::error_code error) {
      if (!error) end_in_order(context, server, last);
    });
  }
  std::fputs(describe_links(options, server.port(), key, practice_key).c_str(), stdout);
  std::fflush(stdout);
  if (!options.ready_file.empty())
    if (auto written = write_text_file(options.ready_file, std::to_string(server.port()) + "\n");
        !written)
      return written;
  log::info("listening at {}:{}, Ctrl-C ends it", options.address, server.port());
  if (server.metrics_port() != 0)
    log::info("figures at {}:{}/metrics", options.metrics_address, server.metrics_port());
  try {
    context.run();
  } catch (const std::exception& exception) {
    return Error{
        ErrorCode::ResourceMissing,
        std::string("the page has ended: its network thread failed (") + exception.what() + ")"};
  }
  return {};
}

}  // namespace
}  // namespace trocar::app

int main(int argc, char** argv) {
  using namespace trocar::app;
  return run_service<WebOptions>({"trocar-web", parse_web_command_line, check_web_start, run_web},
                                 argc, argv);
}
