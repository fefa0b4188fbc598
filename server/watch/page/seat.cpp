#include "server/watch/page/seat.h"

#include "common/base/no_throw.h"
#include "common/base/spawn.h"
#include "common/base/timing.h"
#include "proto/wire.pb.h"
#include "server/watch/page/page_messages.h"

namespace trocar::page {
namespace {

using follow::News;

constexpr std::size_t kSurfacesWaiting = 4;  // as many fit, however large the organ is
constexpr std::size_t kMuchWaitingBytes =
    64 * 1024;  // then what the next one makes stale is left out
constexpr std::uint64_t kKeyframeGapNs = 250'000'000;
constexpr std::chrono::seconds kWelcomeDeadline{5};
// Three frames' time without a new one: the session is paused.
constexpr std::uint64_t kFinePauseNs = 50'000'000;
// While a frame or a part is held back, so often it is seen whether it may go.
constexpr std::chrono::milliseconds kPaceInterval{10};
constexpr int kTries = 2;
constexpr double kMostMessagesPerSecond = 300;  // a page acknowledges 63 frames a second

}  // namespace

Seat::Seat(BrowserSocket& browser, Bridge& bridge, const JoinRequest& request)
    : browser_(browser),
      bridge_(bridge),
      request_(request),
      messages_(kMostMessagesPerSecond, monotonic_ns()),
      news_(browser.executor()),
      up_ended_(browser.executor(), asio::steady_timer::time_point::max()) {}

void Seat::cut() {
  is_cut_ = true;
  wake();
}

// Coroutines here hold no temporaries across a co_await: GCC 12 miscompiles some of them otherwise.
asio::awaitable<void> Seat::run(const follow::SessionAddress& session) {
  // The session closes a connection whose last guest has left: who comes just then begins another.
  bool is_there = false;
  for (int i = 0; i < kTries && !is_there && !is_last_ && !is_cut_; ++i) {
    forget_last_try();
    is_there = co_await join(session);
    if (!is_there) co_await leave_carrier();
  }
  if (is_there) {
    ++bridge_.counters.watchers;
    ++bridge_.counters.joins;
    is_up_running_ = true;
    const auto self = shared_from_this();
    spawn(browser_.executor(), read_up(), [self](std::exception_ptr failure) {
      self->is_up_running_ = false;
      self->up_ended_.cancel();
      rethrow(failure);
    });
  } else if (!is_last_) {
    refuse(reason_to_wait(request_, wire::EndReason::ServerClosing),
           "the session does not answer: try again in a moment");
  }
  co_await write_down();
  if (is_there) {
    co_await leave_carrier();
    --bridge_.counters.watchers;
  }
}

void Seat::forget_last_try() {
  is_lost_ = is_welcome_ = false;
  waiting_.clear();
  waiting_bytes_ = 0;
  barrier_.reset();
}

asio::awaitable<void> Seat::finish() {
  while (is_up_running_) co_await up_ended_.async_wait(kNoThrow);
}

// Nothing is sent before the certificate is that of the code.
asio::awaitable<bool> Seat::join(const follow::SessionAddress& session) {
  carrier_ = bridge_.carrier_of(session, browser_.executor());
  const bool is_reached = co_await carrier_->reach();
  if (is_cut_) co_return false;
  if (!is_reached) {
    refuse(reason_to_wait(request_, wire::EndReason::ServerClosing), carrier_->why());
    co_return false;
  }
  if (carrier_->code() != request_.code.certificate) {
    ++bridge_.counters.refused;
    ++bridge_.counters.wrong_codes;
    bridge_.limiter.record_wrong_try(browser_.peer_address(), monotonic_ns());
    refuse(wire::EndReason::CodeWrong,
           "the join code is not of this session: check it, or ask for a new link");
    co_return false;
  }
  const bool is_welcome = co_await say_hello();
  co_return is_welcome;
}

asio::awaitable<bool> Seat::say_hello() {
  number_ = carrier_->add(*this);
  const auto hello = hello_of(request_);
  const BytesView body = BytesView(*hello).subspan(wire::kHeaderBytes);
  const bool is_said = co_await carrier_->say(number_, body, false);
  if (!is_said) co_return false;
  const auto deadline = std::chrono::steady_clock::now() + kWelcomeDeadline;
  while (!is_welcome_ && !is_last_ && !is_lost_ && !is_cut_ &&
         std::chrono::steady_clock::now() < deadline) {
    news_.expires_at(deadline);
    co_await news_.async_wait(kNoThrow);
  }
  co_return is_welcome_ && !is_lost_ && !is_cut_;
}

asio::awaitable<void> Seat::leave_carrier() {
  if (number_ == 0) co_return;
  carrier_->remove(number_);
  const BytesView nothing;
  co_await carrier_->say(number_, nothing, true);
  number_ = 0;
}

// ---- what he is told ----

void Seat::refuse(wire::EndReason reason, const std::string& text) {
  why_ = text;
  tell(wire::encode_goodbye(reason, text));
  is_last_ = true;
}

void Seat::tell(const wire::SharedBytes& framed) {
  if (!waiting_.empty() && waiting_bytes_ + framed->size() > most_waiting_) {
    why_ = "what cannot be skipped has piled up";
    browser_.cut();
    return cut();
  }
  waiting_bytes_ += framed->size();
  waiting_.push_back(framed);
  wake();
}

void Seat::take(BytesView envelope, bool is_last) {
  proto::Envelope message;
  if (!envelope.empty() && wire::decode_envelope(envelope, message).ok()) {
    if (message.has_welcome()) {
      is_welcome_ = true;
      slot_ = message.welcome().participant();
      if (carrier_) carrier_->note_further(message.welcome());
    }
    if (message.has_goodbye()) {
      why_ = message.goodbye().text();
      if (message.goodbye().reason() == proto::GOODBYE_CODE_WRONG) {
        ++bridge_.counters.wrong_codes;
        bridge_.limiter.record_wrong_try(browser_.peer_address(), monotonic_ns());
      }
    }
    tell(wire::encode_envelope(message));
  }
  if (is_last) is_last_ = true;
  wake();
}

void Seat::hear(follow::News news, const wire::SharedBytes& framed) {
  if (news == News::LastFrame) barrier_ = framed;
  if (!has_begun_) return wake();  // all of it comes at once
  switch (news) {
    case News::NewSurface:
      given_.reset();
      return tell(framed);
    case News::Event:
      return tell(framed);
    case News::Fleeting:
      if (waiting_bytes_ < kMuchWaitingBytes) tell(framed);
      return;
    case News::LastFrame:
    case News::Frame:
    case News::WholeFrame:
    case News::FinePart:
    case News::Nothing:
      return wake();
  }
}

void Seat::lose() {
  is_lost_ = true;
  wake();
}

void Seat::begin() {
  has_begun_ = true;
  given_.reset();
  auto& copy = carrier_->copy();
  most_waiting_ = std::max(kMostWaitingBytes, kSurfacesWaiting * copy.topology()->size());
  for (const auto& message : copy.all_but_frames()) tell(message);
}

wire::SharedBytes Seat::next_message() {
  if (is_welcome_ && !has_begun_ && carrier_->copy().has_frame()) begin();
  if (!waiting_.empty()) {
    auto next = std::move(waiting_.front());
    waiting_.pop_front();
    waiting_bytes_ -= next->size();
    return next;
  }
  if (!has_begun_ || is_last_ || !carrier_->copy().has_frame()) return nullptr;
  auto next = next_frame();
  return next ? next : next_fine_part();
}

bool Seat::awaits_fine_part() const {
  return has_begun_ && fine_parts_.next() < carrier_->copy().fine_parts().size();
}

wire::SharedBytes Seat::next_fine_part() {
  if (!awaits_fine_part()) return nullptr;
  const auto newest = carrier_->copy().frame();
  const auto now = monotonic_ns();
  const bool is_paused = fine_parts_.may_send(newest) && now - fine_ns_ > kFinePauseNs;
  if (!fine_parts_.has_arrived() && !is_paused) return nullptr;
  const auto& part = carrier_->copy().fine_parts()[fine_parts_.next()];
  fine_parts_.on_sent(newest);
  fine_ns_ = now;
  return part;
}

wire::SharedBytes Seat::next_frame() {
  auto& copy = carrier_->copy();
  const auto newest = copy.frame();
  if (given_ == newest) {
    if (!is_state_told_ && copy.state()) {
      is_state_told_ = true;
      return copy.state();
    }
    return std::exchange(barrier_, nullptr);
  }
  const auto now = monotonic_ns();
  if (!barrier_ && !pacer_.may_send(now)) return nullptr;
  const auto message = copy.frame_from(given_);
  if (given_ && newest > *given_ + 1) bridge_.counters.frames_skipped += newest - *given_ - 1;
  given_ = newest;
  is_state_told_ = false;
  pacer_.on_sent(newest, now);
  return message;
}

asio::awaitable<void> Seat::write_down() {
  while (!is_cut_) {
    const auto next = next_message();
    if (next) {
      const BytesView body = BytesView(*next).subspan(wire::kHeaderBytes);
      ++bridge_.counters.messages_down;
      bridge_.counters.bytes_down += body.size();
      const bool is_written = co_await browser_.write(body);
      if (!is_written) break;
      continue;
    }
    if (is_last_ || is_lost_) break;
    const bool is_held_back = has_begun_ && carrier_->copy().has_frame() &&
                              (given_ != carrier_->copy().frame() || awaits_fine_part());
    if (is_held_back)
      news_.expires_after(kPaceInterval);
    else
      news_.expires_at(asio::steady_timer::time_point::max());
    co_await news_.async_wait(kNoThrow);
  }
}

// ---- what he says ----

Seat::Verdict Seat::heed_ack(Frame frame) {
  if (!given_ || frame > *given_) return Verdict::Forbidden;
  pacer_.on_acknowledged(frame, monotonic_ns());
  fine_parts_.on_acknowledged(frame);
  // The session wants to hear of its last frame from everybody.
  return carrier_->copy().last_frame() == frame ? Verdict::ForSession : Verdict::Done;
}

Seat::Verdict Seat::heed(BytesView envelope) {
  proto::Envelope message;
  if (!read_page_message(envelope, wire::Role::Observer, message)) return Verdict::Forbidden;
  if (message.has_frame_ack()) return heed_ack(message.frame_ack().frame());
  if (message.has_keyframe_request()) {
    const auto now = monotonic_ns();
    if (!has_begun_ || now - keyframe_ns_ < kKeyframeGapNs) return Verdict::Done;
    keyframe_ns_ = now;
    given_.reset();
    tell(carrier_->copy().topology());
    return Verdict::Done;
  }
  if (!message.has_ping()) return Verdict::ForSession;
  const auto server_us = carrier_->clock().at(monotonic_ns() / 1000);
  if (server_us == 0) return Verdict::ForSession;
  if (waiting_bytes_ < kMuchWaitingBytes)
    tell(wire::encode_pong(message.ping().client_time_us(), carrier_->copy().tick(), server_us));
  return Verdict::Done;
}

// A page that says that it leaves is said to leave; one that is lost may come back, so that the
// session keeps its place.
asio::awaitable<void> Seat::read_up() {
  while (!is_cut_ && !is_last_ && !is_lost_) {
    const auto message = co_await browser_.read();
    using Kind = BrowserMessage::Kind;
    if (message.kind == Kind::Closed) {
      const auto bye = wire::encode_bye("the page was closed");
      const BytesView body = BytesView(*bye).subspan(wire::kHeaderBytes);
      if (number_ != 0) co_await carrier_->say(number_, body, false);
      break;
    }
    if (message.kind != Kind::Binary) break;
    ++bridge_.counters.messages_up;
    bridge_.counters.bytes_up += message.bytes.size();
    if (!messages_.take(1, monotonic_ns())) {
      why_ = "its page said too much in a second";
      break;
    }
    const auto verdict = heed(message.bytes);
    if (verdict == Verdict::Forbidden) {
      why_ = "its page said something that a page may not say";
      break;
    }
    if (verdict == Verdict::Done || number_ == 0) continue;
    const BytesView body(message.bytes);
    const bool is_said = co_await carrier_->say(number_, body, false);
    if (!is_said) break;
  }
  cut();
}

}  // namespace trocar::page
