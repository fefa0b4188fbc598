// trocar-hall: starts, lists and ends sessions on one machine.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <functional>
#include <memory>

#include "common/base/log.h"
#include "common/base/signals.h"
#include "common/base/text_file.h"
#include "server/app/config/service.h"
#include "server/app/hall/hall_bus.h"
#include "server/app/hall/hall_commands.h"
#include "server/app/hall/hall_server.h"
#include "server/app/hall/hall_start.h"
#include "server/hall/sessions/sessions.h"

namespace trocar::app {
namespace {

constexpr std::chrono::milliseconds kEndPoll{100};

// All sessions end in order; the hall ends when their recordings are closed.
class Ending {
 public:
  // `bus`: null: none.
  Ending(asio::io_context& context, hall::Sessions& sessions, HallServer& server, HallBus* bus)
      : context_(context), sessions_(sessions), server_(server), bus_(bus), timer_(context) {}

  void begin() {
    server_.stop();
    if (bus_ != nullptr) bus_->stop();
    sessions_.end_all();
    wait();
  }

 private:
  void wait() {
    if (sessions_.list().empty()) {
      sessions_.stop();
      return context_.stop();
    }
    timer_.expires_after(kEndPoll);
    timer_.async_wait([this](boost::system::error_code error) {
      if (!error) wait();
    });
  }

  asio::io_context& context_;
  hall::Sessions& sessions_;
  HallServer& server_;
  HallBus* const bus_;
  asio::steady_timer timer_;
};

Status run_hall(const HallOptions& options) {
  auto start = prepare_hall(options);
  if (!start) return start.error();
  asio::io_context context{1};
  auto sessions =
      hall::Sessions::open(context, std::move(start->config), std::move(start->server_program));
  if (!sessions) return sessions.error();
  auto server = HallServer::listen(context, **sessions, start->key, start->tls);
  if (!server) return server.error();
  std::unique_ptr<HallBus> bus;
  if (!options.nats.url.empty()) {
    auto opened = HallBus::open(context, **server, options.nats, start->key);
    if (!opened) return opened.error();
    bus = std::move(*opened);
    log::info("on the bus as {}", bus->name());
  }
  Ending ending(context, **sessions, **server, bus.get());
  asio::signal_set signals(context);
  for (const int signal : ending_signals()) signals.add(signal);
  signals.async_wait([&](boost::system::error_code error, int) {
    if (!error) ending.begin();
  });
  (*sessions)->watch();
  if (!options.ready_file.empty())
    if (auto written =
            write_text_file(options.ready_file, std::to_string((*server)->port()) + "\n");
        !written)
      return written;
  log::info("listening at {}:{}, Ctrl-C ends it and its sessions", (*sessions)->config().address,
            (*server)->port());
  try {
    context.run();
  } catch (const std::exception& exception) {
    return Error{ErrorCode::ResourceMissing,
                 std::string("the hall has ended: its network thread failed (") + exception.what() +
                     "); its sessions go on, start it again"};
  }
  return {};
}

Status run(const HallOptions& options) {
  return options.command == HallCommand::Serve ? run_hall(options) : run_hall_command(options);
}

}  // namespace
}  // namespace trocar::app

int main(int argc, char** argv) {
  using namespace trocar::app;
  return run_service<HallOptions>({"trocar-hall", parse_hall_command_line, check_hall_start, run},
                                  argc, argv);
}
