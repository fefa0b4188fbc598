#include "server/watch/relay/relay.h"

#include <algorithm>

#include "common/base/log.h"
#include "common/wire/session_messages.h"
#include "proto/wire.pb.h"

namespace trocar::relay {
namespace {

using std::chrono::milliseconds;
using wire::EndReason;

constexpr milliseconds kAttentionPeriod{50};
constexpr milliseconds kGoodbyeDeadline{2500};  // a little more than the flush deadline
constexpr milliseconds kGoodbyePoll{20};
constexpr int kMostNewcomers = 256;           // a crowd comes back at once
constexpr std::size_t kMostEarly = 16;        // Participants, and little else
constexpr std::size_t kSurfacesInOutbox = 8;  // as the server has it

}  // namespace

Relay::Relay(asio::io_context& context, std::unique_ptr<follow::Upstream> upstream,
             RelayOptions options, RelayEvents events)
    : context_(context),
      options_(std::move(options)),
      events_(std::move(events)),
      upstream_(std::move(upstream)),
      attention_(context),
      end_timer_(context) {}

Relay::~Relay() = default;

void Relay::start() {
  upstream_->start(
      {.welcome = [this](const auto& welcome) { take_welcome(welcome); },
       .message = [this](const auto& message, const auto& framed) { return take(message, framed); },
       .lost =
           [this](const std::string&) {
             if (crowd_) crowd_->note_lost();
           },
       .over = [this](EndReason reason, const std::string& text) { note_over(reason, text); }});
}

// ---- from the server ----

void Relay::take_welcome(const proto::Welcome& welcome) {
  welcome_ = std::make_unique<proto::Welcome>(welcome);
  early_.clear();
  if (crowd_) crowd_->begin(welcome);
  log::info("{} the session at {}", crowd_ ? "back in" : "in", upstream_->name());
}

Status Relay::take(const proto::Envelope& message, const wire::SharedBytes& framed) {
  if (is_ending_) return {};
  if (!crowd_ && !message.has_surface_topology()) {
    if (early_.size() < kMostEarly) early_.push_back(framed);
    return {};
  }
  if (crowd_) return take_in_crowd(message, framed);
  if (const auto opened = open(framed->size()); !opened) {
    fail(opened.error());
    return {};
  }
  crowd_->begin(*welcome_);
  for (const auto& before : std::exchange(early_, {})) {
    proto::Envelope earlier;
    const auto body = BytesView(*before).subspan(wire::kHeaderBytes);
    if (!wire::decode_envelope(body, earlier).ok()) continue;
    if (auto taken = take_in_crowd(earlier, before); !taken) return taken;
  }
  return take_in_crowd(message, framed);
}

Status Relay::take_in_crowd(const proto::Envelope& message, const wire::SharedBytes& framed) {
  auto taken = crowd_->take(message, framed);
  if (taken && !is_listening_ && crowd_->has_picture()) begin_listening();
  return taken;
}

void Relay::note_over(EndReason reason, const std::string& text) {
  const bool is_closed = reason == EndReason::ServerClosing || reason == EndReason::Unspecified;
  if (!is_closed || !is_listening_)
    outcome_ = Error{is_closed ? ErrorCode::ResourceMissing : ErrorCode::Refused, text};
  end(is_closed ? EndReason::ServerClosing : reason, text);
}

void Relay::fail(const Error& error) {
  outcome_ = error;
  end(EndReason::Unspecified, error.message);
}

// ---- to the watchers ----

Status Relay::open(std::size_t topology_bytes) {
  auto tcp = options_.tcp;
  tcp.outbox_bytes = std::max(tcp.outbox_bytes, kSurfacesInOutbox * topology_bytes);
  tcp.max_newcomers = tcp.max_newcomers_per_address = kMostNewcomers;
  tcp.max_connections = static_cast<int>(options_.most_watchers) + kMostNewcomers;
  tcp.plain_reply = wire::encode_goodbye(
      EndReason::Version,
      "this relay speaks TLS 1.3 only: use a client of its release, without --insecure-loopback");
  auto listening = net::TcpServer::listen(context_, tcp);
  if (!listening) return listening.error();
  tcp_ = std::move(*listening);
  connections_ = std::make_unique<crowd::GuestConnections>(*tcp_);
  crowd::CrowdOptions crowd;
  crowd.secret = options_.secret;
  crowd.most_watchers = options_.most_watchers;
  crowd.has_datagrams = tcp_->has_datagrams();
  crowd.further_addresses = options_.further_addresses;
  crowd.say_up = [this](const proto::Envelope& message) { upstream_->say(message); };
  crowd.server_time_us = [this](std::uint64_t now_us) { return upstream_->server_time_us(now_us); };
  crowd_ = std::make_unique<crowd::Crowd>(*connections_, std::move(crowd));
  connections_->set_handler(crowd_->handler());
  return {};
}

void Relay::begin_listening() {
  is_listening_ = true;
  tcp_->start(*connections_);
  attend();
  if (events_.ready) events_.ready(tcp_->port());
}

void Relay::attend() {
  attention_.expires_after(kAttentionPeriod);
  attention_.async_wait([this](boost::system::error_code error) {
    if (error || is_ending_) return;
    crowd_->attend();
    attend();
  });
}

RelayFigures Relay::figures() const {
  RelayFigures figures{.is_connected = upstream_->is_welcome(),
                       .is_ready = is_listening_,
                       .returns = upstream_->returns(),
                       .server_bytes = upstream_->bytes_received()};
  if (!crowd_) return figures;
  figures.watchers = crowd_->watcher_count();
  figures.connections = tcp_->connection_count();
  figures.crowd = crowd_->counters();
  figures.frames = crowd_->frame_counters();
  figures.tcp = tcp_->counters();
  figures.datagrams = tcp_->datagram_counters();
  return figures;
}

// ---- the end ----

void Relay::end(EndReason reason, const std::string& text) {
  if (std::exchange(is_ending_, true)) return;
  attention_.cancel();
  upstream_->stop();
  if (tcp_) tcp_->stop_accepting();
  if (crowd_) {
    const auto& counters = crowd_->counters();
    log::info("{}: {} watchers, {} of {} showed the last picture", text, crowd_->watcher_count(),
              counters.equal_answers, counters.answers);
    crowd_->end_all(reason, text);
  }
  await_goodbyes();
}

void Relay::await_goodbyes() {
  const bool is_done =
      waited_ >= kGoodbyePoll && (!tcp_ || tcp_->connection_count() == 0);  // Bye has left
  if (is_done || waited_ >= kGoodbyeDeadline) return events_.over(outcome_);
  waited_ += kGoodbyePoll;
  end_timer_.expires_after(kGoodbyePoll);
  end_timer_.async_wait([this](boost::system::error_code error) {
    if (!error) await_goodbyes();
  });
}

}  // namespace trocar::relay
