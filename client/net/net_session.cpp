#include "client/net/net_session.h"

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/post.hpp>
#include <cmath>

#include "client/replica/printable_message.h"
#include "common/base/log.h"
#include "common/base/spawn.h"
#include "common/base/timing.h"
#include "common/base/version.h"
#include "common/secure/certificate.h"
#include "common/wire/session_messages.h"

namespace trocar::net {
namespace {

// A busy server reads the Bye late, and never from who has reset the connection by ending.
constexpr std::chrono::milliseconds kCloseDeadline{2000};
// How soon a full inbound queue is looked at again: well below one frame.
constexpr std::chrono::milliseconds kRoomRetry{2};
constexpr std::size_t kBuffersPerWrite = 16;
constexpr std::size_t kMaxByeBytes = 200;
constexpr std::chrono::milliseconds kEndPoll{1};  // of a connection's coroutines
constexpr const char* kUnknownName = "no machine is known by this name";

}  // namespace

NetSource::Session::Session(NetSourceOptions options)
    : options_(std::move(options)),
      places_{{options_.host, options_.port}},
      inbound_(options_.inbound_capacity),
      outbound_(options_.outbound_capacity) {
  spawn(context_.get_executor(), run(), [this](std::exception_ptr failure) {
    end_if_failed(failure);
    has_ended_.store(true, std::memory_order_release);
  });
  thread_ = std::thread([this] {
    if (options_.hands != nullptr) take_priority();
    context_.run();
  });
}

NetSource::Session::~Session() {
  thread_.join();
}

// ---- render thread ----

std::optional<NetSource::Session::Arrival> NetSource::Session::try_pop() {
  auto arrival = inbound_.try_pop();
  if (arrival) inbound_bytes_ -= arrival->bytes;
  return arrival;
}

bool NetSource::Session::try_send(const proto::Envelope& message) {
  if (message.ByteSizeLong() + wire::kHeaderBytes > wire::kMaxUpstreamBytes ||
      !outbound_.try_push(std::make_shared<proto::Envelope>(message))) {
    sends_dropped_.fetch_add(1, std::memory_order_relaxed);
    return false;
  }
  if (!is_wake_posted_.exchange(true))
    asio::post(context_, [this] {
      is_wake_posted_.exchange(false);  // acquires what was pushed before
      wake_timer_.cancel();
    });
  return true;
}

void NetSource::Session::request_close(const std::string& reason) {
  asio::post(context_, [this, reason] { begin_close(reason); });
}

std::string NetSource::Session::server_name() const {
  const bool is_ipv6 = options_.host.find(':') != std::string::npos;
  return (is_ipv6 ? "[" + options_.host + "]" : options_.host) + ":" +
         std::to_string(options_.port);
}

// ---- Asio thread ----

void NetSource::Session::end(replica::CloseKind kind, std::string text) {
  if (is_done_) return;
  is_done_ = true;
  close_reason_ = {kind, std::move(text)};
  stop_io();
}

void NetSource::Session::stop_io() {
  boost::system::error_code ignored;
  socket_.close(ignored);
  if (stream_) stream_->socket().close(ignored);
  datagrams_.reset();
  resolver_.cancel();
  for (auto* timer :
       {&retry_timer_, &room_timer_, &ping_timer_, &wake_timer_, &deadline_timer_, &hands_timer_})
    timer->cancel();
}

void NetSource::Session::begin_close(const std::string& reason) {
  if (is_done_ || is_closing_) return;
  if (!is_connected_) return end(replica::CloseKind::Ended, "closed: " + reason);
  is_closing_ = true;
  proto::Envelope envelope;
  envelope.mutable_bye()->set_reason(reason.substr(0, kMaxByeBytes));
  control_.push_back(wire::encode_envelope(envelope));
  wake_timer_.cancel();
  room_timer_.cancel();
  spawn(context_.get_executor(), expire(Clock::now() + kCloseDeadline),
        [this](std::exception_ptr failure) { end_if_failed(failure); });
}

asio::awaitable<void> NetSource::Session::expire(Clock::time_point deadline) {
  deadline_timer_.expires_at(deadline);
  const auto [error] = co_await deadline_timer_.async_wait(kNoThrow);
  const bool is_in_time = is_connected_ && !is_closing_;
  if (error || is_done_ || is_in_time) co_return;
  if (is_closing_) {
    end(replica::CloseKind::Ended, "closed");
  } else {
    stop_io();  // connecting took too long: the pending operation fails and says so
  }
}

wire::SharedBytes NetSource::Session::encode_hello() const {
  wire::Hello hello{.name = options_.participant_name,
                    .role = static_cast<wire::Role>(options_.role),
                    .tools = options_.tools,
                    .acks_every_frame = options_.acks_every_frame,
                    .can_return = options_.can_return};
  if (code_) hello.join_secret = code_->secret;
  if (comeback_.is_allowed()) hello.return_token = bytes_of(std::string_view(comeback_.token()));
  return wire::encode_hello(hello);
}

// Coroutines here hold no temporaries across a co_await and leave the text to plain functions:
// GCC 12 miscompiles some of them otherwise (seen as a trap on resuming).
asio::awaitable<void> NetSource::Session::run() {
  bool has_connected = co_await connect();
  while (has_connected) {
    begin_conversation();
    co_await read_messages();
    break_connection("it was closed");
    const bool is_away = may_come_back();
    if (!is_away && !may_try_again()) {
      end_after_stream();
      co_return;
    }
    co_await await_conversation_end();
    if (is_away)
      has_connected = co_await come_back();
    else
      has_connected = co_await connect();
  }
}

// An exception is a fault of this program: the session ends, and its reason says so.
void NetSource::Session::end_if_failed(const std::exception_ptr& failure) {
  if (!failure) return;
  std::string what = "unknown";
  try {
    std::rethrow_exception(failure);
  } catch (const std::exception& exception) {
    what = exception.what();
  } catch (...) {  // then nothing more is known
  }
  end(replica::CloseKind::Lost, "this client failed (" + what + "): start it again");
}

void NetSource::Session::begin_conversation() {
  is_connected_ = true;
  has_heard_ = is_stalled_ = is_ping_queued_ = is_barrier_ = false;
  clock_ = {};
  has_server_clock_ = false;
  last_heard_ = Clock::now();
  why_broken_.clear();
  in_flight_.clear();
  control_.clear();
  control_.push_back(encode_hello());
  readings_ = {};
  reports_.clear();
  talkers_ = options_.hands != nullptr ? 3 : 2;
  const auto ended = [this](std::exception_ptr failure) {
    --talkers_;
    end_if_failed(failure);
  };
  spawn(context_.get_executor(), write_messages(), ended);
  spawn(context_.get_executor(), ping(), ended);
  if (options_.hands != nullptr) spawn(context_.get_executor(), serve_hands(), ended);
}

// A text that says why stands already if this program has broken it.
void NetSource::Session::break_connection(std::string why) {
  if (!is_connected_ || is_done_) return;
  if (why_broken_.empty()) why_broken_ = std::move(why);
  boost::system::error_code ignored;
  stream_->socket().close(ignored);
  if (!may_come_back() && !may_try_again()) return;
  is_connected_ = false;
  datagrams_.reset();
  why_not_ = "it closed the connection before it answered";
  if (may_come_back()) {
    if (comeback_.is_away())  // no Welcome came: another address may have one
      place_ = (place_ + 1) % places_.size();
    else
      log::warn("the connection to {} broke ({}): trying again", server_name(), why_broken_);
    comeback_.begin(monotonic_ns());
  }
  for (auto* timer : {&wake_timer_, &ping_timer_, &room_timer_, &hands_timer_}) timer->cancel();
}

bool NetSource::Session::may_try_again() const {
  return stream_->has_tls() && !has_heard_ && !is_closing_ && !is_done_ &&
         Clock::now() < connect_until_;
}

// The writer still looks at the stream, which the next connection replaces.
asio::awaitable<void> NetSource::Session::await_conversation_end() {
  while (talkers_ > 0) {
    room_timer_.expires_after(kEndPoll);
    co_await room_timer_.async_wait(kNoThrow);
  }
}

asio::awaitable<bool> NetSource::Session::come_back() {
  why_not_ = "no answer";
  while (!is_done_ && !comeback_.is_over(monotonic_ns())) {
    retry_timer_.expires_after(comeback_.next_pause(monotonic_ns()));
    co_await retry_timer_.async_wait(kNoThrow);
    if (is_done_) break;
    const auto deadline = Clock::now() + options_.return_try;
    spawn(context_.get_executor(), expire(deadline),
          [this](std::exception_ptr failure) { end_if_failed(failure); });
    const bool is_ready = co_await try_to_connect(deadline);
    if (is_ready) co_return true;
    place_ = (place_ + 1) % places_.size();
  }
  end_absence();
  co_return false;
}

void NetSource::Session::note_welcome(const proto::Welcome& welcome) {
  const auto now = monotonic_ns();
  if (comeback_.is_away()) {
    log::info("back in the session at {} after {:.1f} s", server_name(),
              comeback_.figures(now).away_seconds);
    comeback_.end(now);
  }
  if (options_.can_return) comeback_.allow(welcome.return_token(), welcome.return_seconds());
  // Without a certificate to compare, a server could send its clients anywhere.
  if (options_.join_code)
    for (const auto& address : welcome.further_address()) note_place(address);
}

void NetSource::Session::note_place(const std::string& address) {
  NetSourceOptions read;
  if (places_.size() >= kMostPlaces || !parse_server_address(address, read).ok()) return;
  const Place place{read.host, read.port};
  if (std::ranges::find(places_, place) == places_.end()) places_.push_back(place);
}

void NetSource::Session::end_after_stream() {
  if (is_closing_) return end(replica::CloseKind::Ended, "closed");
  end(replica::CloseKind::Lost, "connection to " + server_name() + " broke: the server is gone");
}

void NetSource::Session::end_absence() {
  const auto seconds = std::lround(comeback_.figures(monotonic_ns()).away_seconds);
  end(replica::CloseKind::Lost, "connection to " + server_name() +
                                    " broke, and could not be made "
                                    "again for " +
                                    std::to_string(seconds) + " s (" + why_not_ +
                                    "): the server is gone, or check the network");
}

void NetSource::Session::say_waiting(const std::string& why) const {
  log::info("no server at {} yet ({}): trying for {} s", server_name(), why,
            std::chrono::ceil<std::chrono::seconds>(options_.connect_deadline).count());
}

void NetSource::Session::end_unreachable(const std::string& why) {
  const bool is_unknown = why == kUnknownName;
  end(replica::CloseKind::Unreachable,
      "no server at " + server_name() + " (" + why + "): " +
          (is_unknown ? "check how it is spelt, or give the address that the server printed"
                      : "start trocar-server, or check address and port"));
}

void NetSource::Session::check_silence() {
  // A stream that waits for lost packets is not gone while datagrams come.
  const bool is_alive = Clock::now() - last_datagram_ < options_.return_silence;
  const auto longest =
      comeback_.is_allowed() && !is_alive ? options_.return_silence : options_.silence_deadline;
  if (is_stalled_ || !is_talking() || Clock::now() - last_heard_ <= longest) return;
  if (may_come_back()) return break_connection("it is silent");
  end(replica::CloseKind::Lost,
      has_heard_ ? "connection to " + server_name() + " is silent: check the network"
                 : server_name() + " does not answer: is it a Trocar server?");
}

asio::awaitable<bool> NetSource::Session::connect() {
  const bool is_first = connect_until_ == Clock::time_point{};
  if (is_first) connect_until_ = Clock::now() + options_.connect_deadline;
  const auto deadline = connect_until_;
  spawn(context_.get_executor(), expire(deadline),
        [this](std::exception_ptr failure) { end_if_failed(failure); });
  if (is_first) why_not_ = "no answer";
  bool is_said = false;
  while (!is_done_ && Clock::now() < deadline) {
    if (!is_first || is_said) {
      // Those who were turned away together do not come again together.
      std::uniform_int_distribution<std::int64_t> share(1, 4);
      retry_timer_.expires_after(options_.connect_retry * share(random_));
      co_await retry_timer_.async_wait(kNoThrow);
      if (is_done_) break;
    }
    const bool is_ready = co_await try_to_connect(deadline);
    if (is_ready) co_return true;
    if (is_done_ || Clock::now() >= deadline) break;
    if (!is_said) say_waiting(why_not_);
    is_said = true;
  }
  end_unreachable(why_not_);
  co_return false;
}

// One try at each of the server's addresses. False: the session has ended, or another may help.
asio::awaitable<bool> NetSource::Session::try_to_connect(Clock::time_point deadline) {
  const auto place = places_[place_];
  const auto port = std::to_string(place.port);
  const auto [unresolved, endpoints] = co_await resolver_.async_resolve(place.host, port, kNoThrow);
  if (unresolved) why_not_ = kUnknownName;
  for (const auto& endpoint : endpoints) {
    if (is_done_ || Clock::now() >= deadline) break;
    boost::system::error_code ignored;
    socket_.close(ignored);
    const auto [error] = co_await socket_.async_connect(endpoint, kNoThrow);
    if (error && error != asio::error::operation_aborted) why_not_ = error.message();
    if (error) continue;
    socket_.set_option(tcp::no_delay(true), ignored);
    stream_.emplace(std::move(socket_), options_.tls);
    const bool is_ready = co_await secure_stream();
    if (is_done_) co_return false;
    if (!is_ready) continue;
    deadline_timer_.cancel();
    co_return true;
  }
  co_return false;
}

// False: the session has ended, or another try may help.
asio::awaitable<bool> NetSource::Session::secure_stream() {
  if (!stream_->has_tls()) co_return true;
  const auto error = co_await stream_->begin_tls(places_[place_].host);
  if (is_done_) co_return false;
  if (error) {
    end_insecure(error);
    co_return false;
  }
  co_return accept_server();
}

void NetSource::Session::end_insecure(const boost::system::error_code& error) {
  if (error == asio::error::operation_aborted) return;  // the deadline, which says so
  if (secure::may_try_again(error) || comeback_.is_away()) {
    why_not_ = "it closed the connection before TLS was there";
    return;
  }
  end(replica::CloseKind::Refused,
      server_name() + ": " + secure::describe_handshake_failure(error));
}

// Nothing has been sent yet: a server that is not the right one learns neither name nor secret.
bool NetSource::Session::accept_server() {
  if (!options_.join_code) return true;
  if (!code_) {
    const auto code = options_.join_code();
    if (!code) {
      end(replica::CloseKind::Refused, code.error().message);
      return false;
    }
    code_ = *code;
  }
  const bool is_right =
      options_.trusts_ca ||
      secure::code_of_certificate(stream_->peer_certificate_der()) == code_->certificate;
  if (!is_right && place_ > 0)
    why_not_ = places_[place_].host + " shows another certificate";
  else if (!is_right)
    end(replica::CloseKind::Refused,
        server_name() +
            " is not the server of this join code, its certificate is another: nothing was sent; "
            "check the code's first eight characters and the address");
  return is_right;
}

asio::awaitable<bool> NetSource::Session::read_exactly(std::uint8_t* to, std::size_t count) {
  const auto [error, taken] = co_await stream_->read_all(asio::buffer(to, count));
  bytes_received_.fetch_add(taken, std::memory_order_relaxed);
  co_return !error;
}

asio::awaitable<void> NetSource::Session::read_messages() {
  std::array<std::uint8_t, wire::kHeaderBytes> header{};
  while (is_talking()) {
    const bool has_header = co_await read_exactly(header.data(), header.size());
    if (!has_header || !make_room_for(header)) break;
    const bool has_body = co_await read_exactly(body_.data(), body_.size());
    if (!has_body) break;
    const auto message = pop_message();
    if (!message) continue;
    co_await deliver(message, header.size() + body_.size());
    end_if_final(*message);
  }
}

bool NetSource::Session::make_room_for(std::span<const std::uint8_t, wire::kHeaderBytes> header) {
  const auto length = wire::decode_length(header, wire::kMaxDownstreamBytes);
  if (!length)
    end(replica::CloseKind::Lost, server_name() + ": " + length.error().message);
  else
    body_.resize(*length);
  return length.ok();
}

// Returns the message for the render thread; null if it is this layer's own business or broken.
std::shared_ptr<const proto::Envelope> NetSource::Session::pop_message() {
  last_heard_ = Clock::now();
  auto message = std::make_shared<proto::Envelope>();
  if (const auto decoded = wire::decode_envelope(body_, *message); !decoded) {
    end(replica::CloseKind::Lost, server_name() + ": " + decoded.error().message);
    return nullptr;
  }
  messages_received_.fetch_add(1, std::memory_order_relaxed);
  replica::make_printable(*message);
  if (message->has_pong()) {
    note_pong(message->pong());
    return nullptr;
  }
  if (message->message_case() == proto::Envelope::MESSAGE_NOT_SET) return nullptr;
  if (message->has_surface_frame()) frames_received_.fetch_add(1, std::memory_order_relaxed);
  has_heard_ = true;
  heed(*message);
  if (options_.before_message) options_.before_message();
  return message;
}

void NetSource::Session::note_pong(const proto::Pong& pong) {
  const auto now_us = monotonic_ns() / 1000;
  round_trip_seconds_ = static_cast<double>(now_us - pong.client_time_us()) * 1e-6;
  clock_.add(pong.client_time_us(), pong.server_time_us(), now_us);
  if (!clock_.is_known()) return;
  shortest_round_trip_seconds_ = clock_.shortest_round_trip_us() * 1e-6;
  server_offset_us_ = clock_.offset_us();
  has_server_clock_ = true;
}

// This layer itself learns something from messages for the replica, before they are pushed: whoever
// takes Welcome there is not away any more.
void NetSource::Session::heed(const proto::Envelope& message) {
  pass_on_to_hands(message);
  if (message.has_barrier()) is_barrier_ = true;
  if (!message.has_welcome()) return;
  note_welcome(message.welcome());
  if (message.welcome().has_datagrams()) begin_datagrams();
}

void NetSource::Session::begin_datagrams() {
  if (!options_.wants_datagrams) return;
  const auto key = stream_->datagram_key();
  boost::system::error_code error;
  const auto server = stream_->socket().remote_endpoint(error);
  if (!key || error) return;
  datagrams_ = std::make_unique<DatagramPath>(
      context_, asio::ip::udp::endpoint(server.address(), server.port()), *key,
      [this](std::shared_ptr<const proto::Envelope> message, std::size_t bytes) {
        deliver_datagram(std::move(message), bytes);
      });
}

// Datagrams wait for nobody: without room they are lost, as on the way.
void NetSource::Session::deliver_datagram(std::shared_ptr<const proto::Envelope> message,
                                          std::size_t bytes) {
  datagram_bytes_received_ = datagrams_->bytes_received();
  datagrams_received_ = datagrams_->loss().received();
  datagrams_lost_ = datagrams_->loss().lost();
  last_datagram_ = Clock::now();
  const bool is_expected = message->has_surface_slice() || message->has_frame_state_part() ||
                           message->has_surface_change() || message->has_haptic_patches();
  if (!is_expected) return;
  if (message->has_surface_slice()) slices_received_.fetch_add(1, std::memory_order_relaxed);
  pass_on_to_hands(*message);
  messages_received_.fetch_add(1, std::memory_order_relaxed);
  if (options_.before_message) options_.before_message();
  try_push({std::move(message), monotonic_ns(), bytes});
}

// One message fits whatever its size, as long as nothing else waits.
bool NetSource::Session::try_push(Arrival arrival) {
  const auto bytes = arrival.bytes;
  const auto waiting = inbound_bytes_.load();
  if (waiting > 0 && waiting + bytes > options_.inbound_bytes) return false;
  inbound_bytes_ += bytes;
  const bool is_pushed = inbound_.try_push(std::move(arrival));
  if (!is_pushed) inbound_bytes_ -= bytes;
  return is_pushed;
}

void NetSource::Session::end_if_final(const proto::Envelope& message) {
  const bool has_timed_out = message.goodbye().reason() == proto::GOODBYE_TIMEOUT;
  // Another address that says no does not end the session at the server's own.
  const bool is_elsewhere = place_ > 0 && comeback_.is_away();
  if (is_elsewhere && message.has_goodbye())
    log::warn("{} says no: {}", places_[place_].host, message.goodbye().text());
  if (message.has_goodbye() && (has_timed_out || is_elsewhere) && may_come_back())
    return break_connection("the server has heard nothing for too long");
  if (message.has_goodbye()) {
    const bool is_over = message.goodbye().reason() == proto::GOODBYE_SERVER_CLOSING;
    end(is_over ? replica::CloseKind::Ended : replica::CloseKind::Refused,
        "server: " + message.goodbye().text());
  } else if (message.has_welcome() && message.welcome().protocol_major() != kProtocolMajor) {
    end(replica::CloseKind::Refused,
        "server speaks protocol " + std::to_string(message.welcome().protocol_major()) +
            ", this client " + std::to_string(kProtocolMajor) + ": use programs of one release");
  }
}

asio::awaitable<void> NetSource::Session::deliver(std::shared_ptr<const proto::Envelope> message,
                                                  std::size_t bytes) {
  const Arrival arrival{std::move(message), monotonic_ns(), bytes};
  while (!try_push(arrival)) {
    if (!is_talking() || is_closing_) co_return;
    is_stalled_ = true;
    room_timer_.expires_after(kRoomRetry);
    co_await room_timer_.async_wait(kNoThrow);
  }
  is_stalled_ = false;
  last_heard_ = Clock::now();
}

void NetSource::Session::take_outbound() {
  take_from_hands();
  while (in_flight_.size() < kBuffersPerWrite) {
    const auto next = outbound_.try_pop();
    if (!next) break;
    if (!has_heard_) continue;  // it was meant for the connection before
    const bool is_carried = datagrams_ && datagrams_->carry(**next);
    if (!is_carried || is_barrier_) in_flight_.push_back(wire::encode_envelope(**next));
  }
  if (datagrams_) datagram_bytes_sent_ = datagrams_->bytes_sent();
}

asio::awaitable<void> NetSource::Session::write_messages() {
  std::vector<asio::const_buffer> buffers;
  while (is_talking()) {
    in_flight_ = std::move(control_);
    control_.clear();
    is_ping_queued_ = false;
    take_outbound();
    if (in_flight_.empty()) {
      // Nothing can slip in between: wakers run on this thread.
      wake_timer_.expires_at(Clock::time_point::max());
      co_await wake_timer_.async_wait(kNoThrow);
      continue;
    }
    buffers.clear();
    for (const auto& frame : in_flight_) buffers.emplace_back(frame->data(), frame->size());
    const auto [error, written] = co_await stream_->write_all(buffers);
    bytes_sent_.fetch_add(written, std::memory_order_relaxed);
    if (error) co_return;  // the reader sees it too and says so
    if (is_closing_ && control_.empty()) {
      boost::system::error_code ignored;
      stream_->socket().shutdown(tcp::socket::shutdown_send, ignored);
      co_return;  // the server closes, or the deadline
    }
  }
}

asio::awaitable<void> NetSource::Session::ping() {
  while (is_talking() && !is_closing_) {
    queue_ping();
    ping_timer_.expires_after(options_.ping_interval);
    co_await ping_timer_.async_wait(kNoThrow);
    check_silence();
  }
}

void NetSource::Session::queue_ping() {
  if (is_ping_queued_) return;  // the last one is still waiting to be written
  proto::Envelope envelope;
  envelope.mutable_ping()->set_client_time_us(monotonic_ns() / 1000);
  control_.push_back(wire::encode_envelope(envelope));
  is_ping_queued_ = true;
  wake_timer_.cancel();
}

}  // namespace trocar::net
