// trocar-impair: a bad network to put between a client and a server.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cmath>

#include "common/base/log.h"
#include "common/base/program.h"
#include "common/base/signals.h"
#include "common/base/text_file.h"
#include "common/impair/proxy.h"
#include "server/app/impair/options.h"

namespace trocar::app {
namespace {

constexpr const char* kProgram = "trocar-impair";

// Runs the proxy until a signal or for its seconds.
class Run {
 public:
  explicit Run(double seconds) : seconds_(seconds) {}

  asio::io_context& context() { return context_; }
  // From here on signals end it in order.
  void begin() {
    boost::system::error_code ignored;
    for (const int signal : ending_signals()) signals_.add(signal, ignored);
    signals_.async_wait([this](boost::system::error_code error, int) {
      if (!error) context_.stop();
    });
    if (seconds_ <= 0) return;
    end_.expires_after(std::chrono::nanoseconds(std::llround(seconds_ * 1e9)));
    end_.async_wait([this](boost::system::error_code error) {
      if (!error) context_.stop();
    });
  }
  Status until_the_end() {
    try {
      context_.run();
    } catch (const std::exception& exception) {
      return Error{
          ErrorCode::ResourceMissing,
          std::string("the proxy has ended: its network thread failed (") + exception.what() + ")"};
    }
    return {};
  }

 private:
  const double seconds_;
  asio::io_context context_{1};
  asio::signal_set signals_{context_};
  asio::steady_timer end_{context_};
};

Status run_proxy(const ImpairOptions& options) {
  Run run(options.seconds);
  auto listening = impair::Proxy::listen(run.context(), options.proxy);
  if (!listening) return listening.error();
  auto& proxy = **listening;
  proxy.start();
  run.begin();
  if (!options.ready_file.empty())
    if (const auto written =
            write_text_file(options.ready_file, std::to_string(proxy.port()) + "\n");
        !written)
      return written;
  log::info("{}:{} to {}:{}, Ctrl-C ends it; up {}; down {}", options.proxy.listen_address,
            proxy.port(), options.proxy.server_host, options.proxy.server_port,
            describe(options.proxy.up), describe(options.proxy.down));
  const auto ran = run.until_the_end();
  proxy.stop();
  const auto& network = proxy.network();
  const auto lost = [](const impair::Direction& direction) {
    return direction.stream.lost.packets + direction.datagrams.lost.packets;
  };
  log::info("{} streams, {} peers of datagrams; lost {} packets up, {} down", network.streams,
            network.peers, lost(network.up), lost(network.down));
  if (network.streams_refused + network.datagrams_refused > 0)
    log::warn("{} streams and {} datagrams were refused: there were too many at once",
              network.streams_refused, network.datagrams_refused);
  if (options.summary_file.empty()) return ran;
  const auto written = write_text_file(options.summary_file, impair::to_json(network));
  return ran ? written : ran;
}

int run(int argc, char** argv) {
  const auto options = parse_impair_command_line(argc, argv);
  if (!options) return report(kProgram, options.error());
  if (!*options) return static_cast<int>(ExitCode::Ok);
  if (const auto set = log::configure(kProgram, (*options)->log_level); !set)
    return report(kProgram, set.error());
  if (const auto ran = run_proxy(**options); !ran) return report(kProgram, ran.error());
  return static_cast<int>(ExitCode::Ok);
}

}  // namespace
}  // namespace trocar::app

int main(int argc, char** argv) {
  trocar::begin_program(trocar::app::kProgram);
  trocar::ignore_broken_pipes();
  return trocar::app::run(argc, argv);
}
