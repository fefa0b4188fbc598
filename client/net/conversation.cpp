#include "client/net/conversation.h"

#include <boost/asio/buffer.hpp>
#include <utility>

#include "client/replica/printable_message.h"
#include "common/base/log.h"
#include "common/base/spawn.h"
#include "common/base/timing.h"
#include "common/base/version.h"
#include "common/wire/session_messages.h"

namespace trocar::net {
namespace {

// How soon a full inbound queue is looked at again: well below one frame.
constexpr std::chrono::milliseconds kRoomRetry{2};
constexpr std::chrono::milliseconds kHandsPeriod{4};
constexpr std::chrono::milliseconds kEndPoll{1};  // of a connection's coroutines
constexpr std::size_t kBuffersPerWrite = 16;
constexpr std::size_t kMaxByeBytes = 200;

}  // namespace

Conversation::Conversation(const ConversationParts& parts, ConversationEvents events)
    : parts_(parts),
      events_(std::move(events)),
      room_timer_(parts.context),
      ping_timer_(parts.context),
      wake_timer_(parts.context),
      hands_timer_(parts.context) {
  if (parts.options.hands) hands_.emplace(*parts.options.hands, parts.figures);
}

void Conversation::begin() {
  is_on_ = true;
  has_heard_ = is_stalled_ = is_ping_queued_ = is_barrier_ = false;
  clock_ = {};
  parts_.figures.has_server_clock = false;
  last_heard_ = Clock::now();
  in_flight_.clear();
  control_.clear();
  control_.push_back(encode_hello());
  if (hands_) hands_->begin();
  talkers_ = hands_ ? 3 : 2;
  const auto ended = [this](std::exception_ptr failure) {
    --talkers_;
    events_.failed(failure);
  };
  const auto executor = parts_.context.get_executor();
  spawn(executor, write(), ended);
  spawn(executor, ping(), ended);
  if (hands_) spawn(executor, serve_hands(), ended);
}

wire::SharedBytes Conversation::encode_hello() const {
  const auto& options = parts_.options;
  wire::Hello hello{.name = options.participant_name,
                    .role = static_cast<wire::Role>(options.role),
                    .tools = options.tools,
                    .acks_every_frame = options.acks_every_frame,
                    .can_return = options.can_return};
  if (const auto& code = parts_.link.code()) hello.join_secret = code->secret;
  if (parts_.comeback.is_allowed())
    hello.return_token = bytes_of(std::string_view(parts_.comeback.token()));
  return wire::encode_hello(hello);
}

void Conversation::say_bye(const std::string& reason) {
  is_closing_ = true;
  proto::Envelope envelope;
  envelope.mutable_bye()->set_reason(reason.substr(0, kMaxByeBytes));
  control_.push_back(wire::encode_envelope(envelope));
  wake_timer_.cancel();
  room_timer_.cancel();
}

void Conversation::cut() {
  is_on_ = false;
  datagrams_.reset();
  for (auto* timer : {&wake_timer_, &ping_timer_, &room_timer_, &hands_timer_}) timer->cancel();
}

// The writer still looks at the stream, which the next connection replaces.
asio::awaitable<void> Conversation::await_end() {
  while (talkers_ > 0) {
    room_timer_.expires_after(kEndPoll);
    co_await room_timer_.async_wait(kNoThrow);
  }
}

asio::awaitable<bool> Conversation::read_exactly(std::uint8_t* to, std::size_t count) {
  const auto [error, taken] = co_await parts_.link.stream().read_all(asio::buffer(to, count));
  parts_.figures.bytes_received += taken;
  co_return !error;
}

asio::awaitable<void> Conversation::read() {
  std::array<std::uint8_t, wire::kHeaderBytes> header{};
  while (is_on_) {
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

bool Conversation::make_room_for(std::span<const std::uint8_t, wire::kHeaderBytes> header) {
  const auto length = wire::decode_length(header, wire::kMaxDownstreamBytes);
  if (!length)
    events_.over(replica::CloseKind::Lost, parts_.link.name() + ": " + length.error().message);
  else
    body_.resize(*length);
  return length.ok();
}

// Returns the message for the render thread; null if it is this layer's own business or broken.
std::shared_ptr<const proto::Envelope> Conversation::pop_message() {
  last_heard_ = Clock::now();
  auto message = std::make_shared<proto::Envelope>();
  if (const auto decoded = wire::decode_envelope(body_, *message); !decoded) {
    events_.over(replica::CloseKind::Lost, parts_.link.name() + ": " + decoded.error().message);
    return nullptr;
  }
  ++parts_.figures.messages_received;
  replica::make_printable(*message);
  if (message->has_pong()) {
    note_pong(message->pong());
    return nullptr;
  }
  if (message->message_case() == proto::Envelope::MESSAGE_NOT_SET) return nullptr;
  if (message->has_surface_frame()) ++parts_.figures.frames_received;
  has_heard_ = true;
  heed(*message);
  if (parts_.options.before_message) parts_.options.before_message();
  return message;
}

void Conversation::note_pong(const proto::Pong& pong) {
  const auto now_us = monotonic_ns() / 1000;
  parts_.figures.round_trip_seconds = static_cast<double>(now_us - pong.client_time_us()) * 1e-6;
  clock_.add(pong.client_time_us(), pong.server_time_us(), now_us);
  if (!clock_.is_known()) return;
  parts_.figures.shortest_round_trip_seconds = clock_.shortest_round_trip_us() * 1e-6;
  parts_.figures.server_offset_us = clock_.offset_us();
  parts_.figures.has_server_clock = true;
}

// This layer itself learns something from messages for the replica, before they are pushed: whoever
// takes Welcome there is not away any more.
void Conversation::heed(const proto::Envelope& message) {
  if (hands_) hands_->hear(message);
  if (message.has_barrier()) is_barrier_ = true;
  if (!message.has_welcome()) return;
  events_.welcome(message.welcome());
  if (message.welcome().has_datagrams()) begin_datagrams();
}

void Conversation::begin_datagrams() {
  if (!parts_.options.wants_datagrams) return;
  const auto key = parts_.link.stream().datagram_key();
  boost::system::error_code error;
  const auto server = parts_.link.stream().socket().remote_endpoint(error);
  if (!key || error) return;
  datagrams_ = std::make_unique<DatagramPath>(
      parts_.context, asio::ip::udp::endpoint(server.address(), server.port()), *key,
      [this](std::shared_ptr<const proto::Envelope> message, std::size_t bytes) {
        deliver_datagram(std::move(message), bytes);
      });
}

// Datagrams wait for nobody: without room they are lost, as on the way.
void Conversation::deliver_datagram(std::shared_ptr<const proto::Envelope> message,
                                    std::size_t bytes) {
  parts_.figures.datagram_bytes_received = datagrams_->bytes_received();
  parts_.figures.datagrams_received = datagrams_->loss().received();
  parts_.figures.datagrams_lost = datagrams_->loss().lost();
  last_datagram_ = Clock::now();
  const bool is_expected = message->has_surface_slice() || message->has_frame_state_part() ||
                           message->has_surface_change() || message->has_haptic_patches();
  if (!is_expected) return;
  if (message->has_surface_slice()) ++parts_.figures.slices_received;
  if (hands_) hands_->hear(*message);
  ++parts_.figures.messages_received;
  if (parts_.options.before_message) parts_.options.before_message();
  parts_.inbound.try_push({std::move(message), monotonic_ns(), bytes});
}

void Conversation::end_if_final(const proto::Envelope& message) {
  const bool has_timed_out = message.goodbye().reason() == proto::GOODBYE_TIMEOUT;
  // Another address that says no does not end the session at the server's own.
  const bool is_elsewhere = parts_.link.is_elsewhere() && parts_.comeback.is_away();
  if (is_elsewhere && message.has_goodbye())
    log::warn("{} says no: {}", parts_.link.host(), message.goodbye().text());
  const bool may_come_back = parts_.comeback.is_allowed() && !is_closing_;
  if (message.has_goodbye() && (has_timed_out || is_elsewhere) && may_come_back)
    return events_.broken("the server has heard nothing for too long");
  if (message.has_goodbye()) {
    const bool is_over = message.goodbye().reason() == proto::GOODBYE_SERVER_CLOSING;
    events_.over(is_over ? replica::CloseKind::Ended : replica::CloseKind::Refused,
                 "server: " + message.goodbye().text());
  } else if (message.has_welcome() && message.welcome().protocol_major() != kProtocolMajor) {
    events_.over(replica::CloseKind::Refused,
                 "server speaks protocol " + std::to_string(message.welcome().protocol_major()) +
                     ", this client " + std::to_string(kProtocolMajor) +
                     ": use programs of one release");
  }
}

asio::awaitable<void> Conversation::deliver(std::shared_ptr<const proto::Envelope> message,
                                            std::size_t bytes) {
  const Arrival arrival{std::move(message), monotonic_ns(), bytes};
  while (!parts_.inbound.try_push(arrival)) {
    if (!is_on_ || is_closing_) co_return;
    is_stalled_ = true;
    room_timer_.expires_after(kRoomRetry);
    co_await room_timer_.async_wait(kNoThrow);
  }
  is_stalled_ = false;
  last_heard_ = Clock::now();
}

void Conversation::take_outbound() {
  if (hands_) hands_->move_to(in_flight_);
  while (in_flight_.size() < kBuffersPerWrite) {
    const auto next = parts_.outbound.try_pop();
    if (!next) break;
    if (!has_heard_) continue;  // it was meant for the connection before
    const bool is_carried = datagrams_ && datagrams_->carry(**next);
    if (!is_carried || is_barrier_) in_flight_.push_back(wire::encode_envelope(**next));
  }
  if (datagrams_) parts_.figures.datagram_bytes_sent = datagrams_->bytes_sent();
}

asio::awaitable<void> Conversation::write() {
  std::vector<asio::const_buffer> buffers;
  while (is_on_) {
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
    const auto [error, written] = co_await parts_.link.stream().write_all(buffers);
    parts_.figures.bytes_sent += written;
    if (error) co_return;  // the reader sees it too and says so
    if (is_closing_ && control_.empty()) {
      boost::system::error_code ignored;
      parts_.link.stream().socket().shutdown(asio::socket_base::shutdown_send, ignored);
      co_return;  // the server closes, or the deadline
    }
  }
}

asio::awaitable<void> Conversation::ping() {
  while (is_on_ && !is_closing_) {
    queue_ping();
    ping_timer_.expires_after(parts_.options.ping_interval);
    co_await ping_timer_.async_wait(kNoThrow);
    check_silence();
  }
}

void Conversation::queue_ping() {
  if (is_ping_queued_) return;  // the last one is still waiting to be written
  proto::Envelope envelope;
  envelope.mutable_ping()->set_client_time_us(monotonic_ns() / 1000);
  control_.push_back(wire::encode_envelope(envelope));
  is_ping_queued_ = true;
  wake_timer_.cancel();
}

void Conversation::check_silence() {
  // A stream that waits for lost packets is not gone while datagrams come.
  const bool is_alive = Clock::now() - last_datagram_ < parts_.options.return_silence;
  const auto longest = parts_.comeback.is_allowed() && !is_alive ? parts_.options.return_silence
                                                                 : parts_.options.silence_deadline;
  if (is_stalled_ || !is_on_ || Clock::now() - last_heard_ <= longest) return;
  if (parts_.comeback.is_allowed() && !is_closing_) return events_.broken("it is silent");
  events_.over(replica::CloseKind::Lost,
               has_heard_ ? "connection to " + parts_.link.name() + " is silent: check the network"
                          : parts_.link.name() + " does not answer: is it a Trocar server?");
}

asio::awaitable<void> Conversation::serve_hands() {
  auto next = Clock::now();
  while (is_on_ && !is_closing_) {
    next = std::max(next + kHandsPeriod, Clock::now());
    hands_timer_.expires_at(next);
    co_await hands_timer_.async_wait(kNoThrow);
    if (!is_on_ || !has_heard_ || is_closing_) continue;
    if (hands_->ask(datagrams_.get(), monotonic_ns())) wake_timer_.cancel();
    if (datagrams_) parts_.figures.datagram_bytes_sent = datagrams_->bytes_sent();
  }
}

}  // namespace trocar::net
