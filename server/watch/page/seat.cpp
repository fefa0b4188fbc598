#include "server/watch/page/seat.h"

#include "common/base/no_throw.h"
#include "common/base/spawn.h"
#include "common/base/timing.h"
#include "proto/wire.pb.h"

namespace trocar::page {
namespace {

constexpr std::size_t kLargestWaiting = 4;  // as many fit, however large the organ is
constexpr std::chrono::seconds kWelcomeDeadline{5};
constexpr int kTries = 2;

}  // namespace

Seat::Seat(http::WebSocket& browser, Bridge& bridge, const JoinRequest& request)
    : browser_(browser),
      bridge_(bridge),
      request_(request),
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
  const bool leads = is_there && request_.role == wire::Role::Instructor;
  if (leads) bridge_.note_leader(session.name, request_.code);
  if (is_there) {
    use_ = bridge_.use_of(session.name);
    ++use_->people;
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
  if (leads) bridge_.forget_leader(session.name, request_.code);
  if (is_there) {
    co_await leave_carrier();
    --bridge_.counters.watchers;
    --use_->people;
  }
}

void Seat::forget_last_try() {
  is_lost_ = is_welcome_ = false;
  waiting_.clear();
  waiting_bytes_ = 0;
}

asio::awaitable<void> Seat::finish() {
  while (is_up_running_) co_await up_ended_.async_wait(kNoThrow);
}

// Nothing is sent before the certificate is that of the code.
asio::awaitable<bool> Seat::join(const follow::SessionAddress& session) {
  carrier_ = bridge_.carrier_of(session, request_.role, browser_.executor());
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

bool Seat::tell(const wire::SharedBytes& framed) {
  most_waiting_ = std::max(most_waiting_, kLargestWaiting * framed->size());
  if (waiting_bytes_ + framed->size() > most_waiting_) return false;
  waiting_bytes_ += framed->size();
  waiting_.push_back(framed);
  wake();
  return true;
}

void Seat::take(const proto::Envelope& message) {
  if (message.has_welcome()) {
    is_welcome_ = true;
    slot_ = message.welcome().participant();
  }
  if (!message.has_goodbye()) return;
  why_ = message.goodbye().text();
  if (message.goodbye().reason() != proto::GOODBYE_CODE_WRONG) return;
  ++bridge_.counters.wrong_codes;
  bridge_.limiter.record_wrong_try(browser_.peer_address(), monotonic_ns());
}

void Seat::finish_after_words() {
  is_last_ = true;
  wake();
}

void Seat::cut_off(const std::string& why) {
  why_ = why;
  browser_.cut();
  cut();
}

void Seat::lose() {
  is_lost_ = true;
  wake();
}

asio::awaitable<void> Seat::write_down() {
  while (!is_cut_) {
    if (!waiting_.empty()) {
      const auto next = waiting_.front();
      waiting_.pop_front();
      const BytesView body = BytesView(*next).subspan(wire::kHeaderBytes);
      ++bridge_.counters.messages_down;
      bridge_.counters.bytes_down += body.size();
      const bool is_written = co_await browser_.write(body);
      waiting_bytes_ -= next->size();
      if (!is_written) break;
      continue;
    }
    if (is_last_ || is_lost_) break;
    news_.expires_at(asio::steady_timer::time_point::max());
    co_await news_.async_wait(kNoThrow);
  }
}

// ---- what he says ----

// A page that says that it leaves is said to leave; one that is lost may come back, so that the
// session keeps its place.
asio::awaitable<void> Seat::read_up() {
  while (!is_cut_ && !is_last_ && !is_lost_) {
    const auto message = co_await browser_.read();
    using Kind = http::WebMessage::Kind;
    if (message.kind == Kind::Closed) {
      const auto bye = wire::encode_bye("the page was closed");
      const BytesView body = BytesView(*bye).subspan(wire::kHeaderBytes);
      if (number_ != 0) co_await carrier_->say(number_, body, false);
      break;
    }
    if (message.kind != Kind::Binary) break;
    ++bridge_.counters.messages_up;
    bridge_.counters.bytes_up += message.bytes.size();
    proto::Envelope envelope;
    if (number_ == 0) continue;
    if (!read_page_message(message.bytes, request_.role, envelope)) {
      why_ = "its page said something that a page may not say";
      break;
    }
    if (deeds_.note(envelope)) use_->deed_ns = monotonic_ns();
    const BytesView body(message.bytes);
    const bool is_said = co_await carrier_->heed_page(number_, body);
    if (!is_said) break;
  }
  cut();
}

}  // namespace trocar::page
