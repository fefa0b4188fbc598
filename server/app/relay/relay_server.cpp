#include "server/app/relay/relay_server.h"

#include "common/base/asio.h"  // before Boost: see there

#include <fmt/format.h>
#include <unistd.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "common/base/log.h"
#include "common/base/signals.h"
#include "common/base/text_file.h"
#include "common/base/writable.h"
#include "common/intake/acceptor.h"
#include "common/secure/certificate.h"
#include "common/secure/kept_identity.h"
#include "common/secure/link_file.h"
#include "common/secure/loopback.h"
#include "common/secure/private_files.h"
#include "common/secure/public_host.h"
#include "common/secure/tls.h"
#include "server/session/monitoring/exposition.h"
#include "server/session/monitoring/figures_server.h"
#include "server/session/net/tcp_server.h"
#include "server/session/replication/validation.h"
#include "server/watch/bus/bus_channel.h"
#include "server/watch/bus/publisher.h"
#include "server/watch/bus/tap.h"
#include "server/watch/follow/uplink.h"
#include "server/watch/relay/relay.h"

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

struct Access {
  secure::TlsContext tls;
  secure::JoinCode code;    // of this relay
  secure::JoinCode server;  // of the server
};

Result<fs::path> state_folder(const RelayOptions& options) {
  if (!options.state_folder.empty()) return fs::absolute(options.state_folder);
  return secure::default_state_folder();
}

Status check_certificate(const RelayOptions& options) {
  const auto folder = state_folder(options);
  if (!folder) return folder.error();
  const bool is_own = options.certificate_file.empty();
  if (is_own)
    if (const auto fine = secure::check_private_folder(*folder); !fine)
      return Error{fine.error().code, "--state: " + fine.error().message};
  std::error_code ignored;
  const bool is_made =
      fs::exists(*folder / "server.crt", ignored) && fs::exists(*folder / "server.key", ignored);
  if (is_own && !is_made) return {};
  const auto kept =
      secure::read_or_make_identity(options.certificate_file, options.key_file, *folder, "server");
  if (!kept) return kept.error();
  const auto tls = secure::make_server_context(kept->identity, kept->source);
  return tls ? Status() : Status(tls.error());
}

Result<Access> prepare_access(const RelayOptions& options) {
  Access access;
  if (options.code) {
    access.server = *options.code;
  } else {
    if (!secure::is_loopback(options.server.host))
      return Error{ErrorCode::Usage, "--code: name an observer's join code of " +
                                         options.server.name + ", or its link with --to"};
    const auto known = secure::read_link_file(options.server.port, "observer");
    if (!known) return Error{known.error().code, "--code: " + known.error().message};
    access.server = *known;
  }
  const auto folder = state_folder(options);
  if (!folder) return folder.error();
  if (options.certificate_file.empty())
    if (const auto made = secure::make_private_folder(*folder); !made) return made.error();
  // The name of a server's: on one machine both show one certificate, and codes are good for both.
  const auto kept =
      secure::read_or_make_identity(options.certificate_file, options.key_file, *folder, "server");
  if (!kept) return kept.error();
  auto tls = secure::make_server_context(kept->identity, kept->source);
  if (!tls) return tls.error();
  const auto der = secure::certificate_der(kept->identity.certificate_pem, kept->source);
  if (!der) return der.error();
  access.tls = std::move(*tls);
  access.code = {secure::code_of_certificate(*der), access.server.secret};
  return access;
}

std::string name_of(const RelayOptions& options) {
  if (!options.name.empty()) return options.name;
  const auto number = options.port != 0 ? static_cast<long>(options.port) : ::getpid();
  return fmt::format("Relay {}", number);
}

std::string invitation(const RelayOptions& options, const secure::JoinCode& code,
                       std::uint16_t port) {
  const auto here = secure::public_host(options.address) + ":" + std::to_string(port);
  return fmt::format(
      "Join code of this relay (trocar-client --role observer --join CODE --server HOST:PORT, or "
      "--join LINK):\n  {:<10}  {}  {}\n",
      "observer", secure::to_text(code), secure::to_link(here, code));
}

std::string to_exposition(const relay::RelayFigures& figures) {
  const auto number = [](auto count) { return static_cast<double>(count); };
  const auto& crowd = figures.crowd;
  const auto& frames = figures.frames;
  monitoring::Exposition text("trocar_relay_");
  text.gauge("connected", "1 while the relay is in the session.", number(figures.is_connected));
  text.counter("returns_total", "Times that it has come back to the server.",
               number(figures.returns));
  text.counter("server_received_bytes_total", "Bytes from the server, or from NATS.",
               number(figures.server_bytes));
  text.gauge("watchers", "People who watch through it.", number(figures.watchers));
  text.gauge("connections", "Connections now.", number(figures.connections));
  text.counter("joins_total", "Joins that were let in, returns as well.", number(crowd.joins));
  text.counter("joins_refused_total", "Joins that were refused.", number(crowd.refused));
  text.counter("wrong_codes_total", "Wrong join codes.", number(crowd.wrong_codes));
  text.counter("ended_total", "Watchers that were too slow or said what nobody may say.",
               number(crowd.ended));
  text.counter("frames_total", "Frames that came from the server.",
               number(frames.frames_published));
  text.counter("watcher_frames_total", "Frames given to watchers.", number(frames.frames_given));
  text.counter("watcher_frames_skipped_total", "Frames left out for watchers that were behind.",
               number(frames.frames_skipped));
  text.counters("sent_bytes_total", "Bytes to watchers.", "path",
                {{"stream", number(figures.tcp.bytes_out)},
                 {"datagram", number(figures.datagrams.bytes_out)}});
  return text.text();
}

class RelayServer {
 public:
  // `context` outlives this.
  RelayServer(asio::io_context& context, const RelayOptions& options, Access access,
              std::unique_ptr<follow::Upstream> upstream);
  ~RelayServer();

  Status run();

 private:
  void note_ready(std::uint16_t port);
  Status open_figures();
  void end();

  asio::io_context& io_;
  const RelayOptions& options_;
  const Access access_;
  asio::signal_set signals_{io_};
  asio::steady_timer limit_{io_};
  relay::Relay relay_;
  std::unique_ptr<monitoring::FiguresServer> figures_;  // null: not asked for
  fs::path link_file_;
  Status outcome_;
};

relay::RelayOptions relay_options(const RelayOptions& options, const Access& access) {
  relay::RelayOptions chosen;
  chosen.secret = access.server.secret;
  chosen.tcp.address = options.address;
  chosen.tcp.port = options.port;
  chosen.tcp.tls = access.tls;
  chosen.tcp.has_datagrams = !options.is_stream_only;
  chosen.most_watchers = static_cast<std::size_t>(options.most_watchers);
  chosen.further_addresses = options.further_addresses;
  return chosen;
}

Result<std::unique_ptr<bus::Channel>> open_channel(asio::io_context& context,
                                                   const RelayOptions& options) {
  auto bus = bus::Bus::connect(options.nats, "trocar-relay " + name_of(options), true);
  if (!bus) return bus.error();
  return std::unique_ptr<bus::Channel>(
      std::make_unique<bus::BusChannel>(context.get_executor(), std::move(*bus)));
}

template <typename Kind>
Result<std::unique_ptr<follow::Upstream>> listening(std::unique_ptr<Kind> made) {
  if (const auto heard = made->listen(); !heard) return heard.error();
  return std::unique_ptr<follow::Upstream>(std::move(made));
}

Result<std::unique_ptr<follow::Upstream>> open_upstream(asio::io_context& context,
                                                        const RelayOptions& options,
                                                        const Access& access) {
  const auto executor = context.get_executor();
  std::unique_ptr<bus::Channel> channel;
  if (!options.nats.url.empty()) {
    auto opened = open_channel(context, options);
    if (!opened) return opened.error();
    channel = std::move(*opened);
  }
  if (!options.from_nats.empty())
    return listening(std::make_unique<bus::Tap>(executor, std::move(channel),
                                                bus::TapOptions{.session = options.from_nats}));
  std::unique_ptr<follow::Upstream> uplink = std::make_unique<follow::Uplink>(
      executor, follow::UplinkOptions{
                    .server = options.server, .code = access.server, .name = name_of(options)});
  if (!channel) return uplink;
  return listening(
      std::make_unique<bus::Publisher>(executor, std::move(uplink), std::move(channel),
                                       bus::PublisherOptions{.session = options.publish}));
}

RelayServer::RelayServer(asio::io_context& context, const RelayOptions& options, Access access,
                         std::unique_ptr<follow::Upstream> upstream)
    : io_(context),
      options_(options),
      access_(std::move(access)),
      relay_(io_, std::move(upstream), relay_options(options_, access_),
             {.ready = [this](std::uint16_t port) { note_ready(port); },
              .over =
                  [this](const Status& outcome) {
                    if (outcome_) outcome_ = outcome;
                    io_.stop();
                  }}) {}

RelayServer::~RelayServer() {
  std::error_code ignored;
  if (!link_file_.empty()) fs::remove(link_file_, ignored);
}

void RelayServer::note_ready(std::uint16_t port) {
  if (auto link = secure::write_link_file(port, {{"observer", access_.code}}); link)
    link_file_ = std::move(*link);
  else
    log::warn("no code file, so clients on this machine need --join, too: {}",
              link.error().message);
  std::fputs(invitation(options_, access_.code, port).c_str(), stdout);
  std::fflush(stdout);
  log::info("room for {} watchers at {}:{}, Ctrl-C ends it", options_.most_watchers,
            options_.address, port);
  if (options_.ready_file.empty()) return;
  outcome_ = write_text_file(options_.ready_file, std::to_string(port) + "\n");
  if (!outcome_) end();
}

Status RelayServer::open_figures() {
  if (options_.metrics_address.empty()) return {};
  const auto well = [] { return std::string(); };
  const auto not_ready = [this]() -> std::string {
    const auto figures = relay_.figures();
    if (!figures.is_ready) return "no picture has come yet";
    return figures.is_connected ? "" : "there is no connection to the server";
  };
  auto listening = monitoring::FiguresServer::listen(
      io_, options_.metrics_address, options_.metrics_port,
      {well, not_ready, [this] { return to_exposition(relay_.figures()); }});
  if (!listening) return listening.error();
  figures_ = std::move(*listening);
  log::info("figures at {}:{}/metrics", options_.metrics_address, figures_->port());
  return {};
}

void RelayServer::end() {
  relay_.end(replication::EndReason::ServerClosing, "the relay ends");
}

Status RelayServer::run() {
  if (auto opened = open_figures(); !opened) return opened;
  for (const int signal : ending_signals()) signals_.add(signal);
  signals_.async_wait([this](boost::system::error_code error, int) {
    if (!error) end();
  });
  if (options_.seconds > 0) {
    limit_.expires_after(std::chrono::nanoseconds(std::llround(options_.seconds * 1e9)));
    limit_.async_wait([this](boost::system::error_code error) {
      if (!error) end();
    });
  }
  relay_.start();
  if (auto ran = net::run(io_); !ran) return ran;
  return outcome_;
}

}  // namespace

Status check_relay(const RelayOptions& options) {
  if (const auto fine = intake::check_address(options.address, "--listen"); !fine) return fine;
  if (!options.metrics_address.empty())
    if (const auto fine = intake::check_address(options.metrics_address, "--metrics"); !fine)
      return fine;
  if (const auto fine = check_certificate(options); !fine) return fine;
  if (!options.nats.url.empty())
    if (const auto fine = bus::Bus::check(options.nats); !fine) return fine;
  if (options.ready_file.empty()) return {};
  const auto fine = check_writable(options.ready_file);
  return fine ? Status()
              : Status(Error{fine.error().code, "--ready-file: " + fine.error().message});
}

Status run_relay(const RelayOptions& options) {
  auto access = prepare_access(options);
  if (!access) return access.error();
  asio::io_context context{1};
  auto upstream = open_upstream(context, options, *access);
  if (!upstream) return upstream.error();
  const auto server =
      std::make_unique<RelayServer>(context, options, std::move(*access), std::move(*upstream));
  return server->run();
}

}  // namespace trocar::app
