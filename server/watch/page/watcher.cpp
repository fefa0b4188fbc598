#include "server/watch/page/watcher.h"

#include <cstring>

#include "common/base/log.h"
#include "common/base/no_throw.h"
#include "common/base/printable.h"
#include "common/base/spawn.h"
#include "common/base/timing.h"
#include "proto/wire.pb.h"
#include "server/watch/page/page_messages.h"

namespace trocar::page {
namespace {

constexpr std::chrono::seconds kJoinDeadline{5};

}  // namespace

Watcher::Watcher(std::unique_ptr<BrowserSocket> browser, Bridge& bridge)
    : browser_(std::move(browser)),
      bridge_(bridge),
      link_(browser_->executor(), bridge.sessions),
      join_deadline_(browser_->executor()),
      up_ended_(browser_->executor(), asio::steady_timer::time_point::max()) {}

void Watcher::cut() {
  is_cut_ = true;
  browser_->cut();
  link_.cut();
  if (seat_) seat_->cut();
  join_deadline_.cancel();
}

// Coroutines here hold no temporaries across a co_await: GCC 12 miscompiles some of them otherwise.
asio::awaitable<void> Watcher::run() {
  const auto self = shared_from_this();
  join_deadline_.expires_after(kJoinDeadline);
  join_deadline_.async_wait([self](boost::system::error_code error) {
    if (!error) self->browser_->cut();
  });
  const bool has_joined = co_await read_join();
  join_deadline_.cancel();
  const auto* session = has_joined ? bridge_.sessions.find(request_.session) : nullptr;
  if (has_joined && session == nullptr) {
    ++bridge_.counters.refused;
    std::string text = "the link names a session that is not here: ask for a new link";
    co_await refuse(wire::EndReason::ProtocolError, std::move(text));
  } else if (has_joined) {
    const auto address = browser_->peer_address();
    log::info("{} joins from {} as {}", printable(request_.name, 64), address,
              wire::name_of(request_.role));
    if (request_.role == wire::Role::Observer)
      co_await watch_with_others(*session);
    else
      co_await watch_alone(*session);
    log::info("{} from {} has left{}{}", printable(request_.name, 64), address,
              why_.empty() ? "" : ": ", printable(why_, 200));
  }
  co_await browser_->close();
  cut();
  if (seat_) co_await seat_->finish();
  while (is_up_running_) co_await up_ended_.async_wait(kNoThrow);
}

asio::awaitable<bool> Watcher::read_join() {
  const auto first = co_await browser_->read();
  if (first.kind != BrowserMessage::Kind::Text) co_return false;
  const auto address = browser_->peer_address();
  const auto wait = bridge_.limiter.seconds_to_wait(address, monotonic_ns());
  if (wait > 0) {
    ++bridge_.counters.refused;
    std::string text =
        "too many wrong codes from here: wait " + std::to_string(wait) + " s, then try again";
    co_await refuse(wire::EndReason::TooManyTries, std::move(text));
    co_return false;
  }
  const auto refusal = read_join_request(first.bytes, request_);
  if (!refusal) co_return true;
  ++bridge_.counters.refused;
  if (refusal->fault == JoinFault::Code) {
    ++bridge_.counters.wrong_codes;
    bridge_.limiter.record_wrong_try(address, monotonic_ns());
  }
  std::string text = refusal->text;
  co_await refuse(refusal->fault == JoinFault::Code ? wire::EndReason::CodeWrong
                                                    : wire::EndReason::ProtocolError,
                  std::move(text));
  co_return false;
}

asio::awaitable<void> Watcher::refuse(wire::EndReason reason, std::string text) {
  const auto frame = wire::encode_goodbye(reason, text);
  const BytesView body = BytesView(*frame).subspan(wire::kHeaderBytes);
  co_await browser_->write(body);
}

asio::awaitable<void> Watcher::watch_with_others(const follow::SessionAddress& session) {
  auto& observers = bridge_.observers;
  const auto address = browser_->peer_address();
  const auto place = observers.place_for(address);
  if (place != access::Room::Place::Free) {
    ++bridge_.counters.refused;
    why_ = place == access::Room::Place::AllFull
               ? "full: all places of this page for observers are taken, come back later"
               : "full: all places for observers from your address are taken, come back later";
    std::string text = why_;
    co_await refuse(reason_to_wait(request_, wire::EndReason::Full), std::move(text));
    co_return;
  }
  observers.enter(address);
  seat_ = std::make_shared<Seat>(*browser_, bridge_, request_);
  if (is_cut_) seat_->cut();
  co_await seat_->run(session);
  why_ = seat_->why();
  observers.leave(address);
}

asio::awaitable<void> Watcher::watch_alone(const follow::SessionAddress& session) {
  const bool is_there = co_await reach_session(session);
  if (!is_there) co_return;
  ++bridge_.counters.watchers;
  ++bridge_.counters.joins;
  is_up_running_ = true;
  const auto self = shared_from_this();
  spawn(browser_->executor(), relay_up(), [self](std::exception_ptr failure) {
    self->is_up_running_ = false;
    self->up_ended_.cancel();
    rethrow(failure);
  });
  co_await relay_down();
  --bridge_.counters.watchers;
}

// Nothing is sent before the certificate is that of the code.
asio::awaitable<bool> Watcher::reach_session(const follow::SessionAddress& session) {
  const bool is_open = co_await link_.open(session);
  if (!is_open) {
    ++bridge_.counters.unreachable;
    std::string text = link_.why();
    co_await refuse(reason_to_wait(request_, wire::EndReason::ServerClosing), std::move(text));
    co_return false;
  }
  if (link_.code() != request_.code.certificate) {
    ++bridge_.counters.refused;
    ++bridge_.counters.wrong_codes;
    bridge_.limiter.record_wrong_try(browser_->peer_address(), monotonic_ns());
    std::string text = "the join code is not of this session: check it, or ask for a new link";
    co_await refuse(wire::EndReason::CodeWrong, std::move(text));
    co_return false;
  }
  const auto hello = hello_of(request_);
  const BytesView bytes(*hello);
  const bool is_said = co_await link_.write(bytes);
  co_return is_said;
}

void Watcher::note_refusal(BytesView envelope) {
  // Only small messages can be a Goodbye.
  constexpr std::size_t kMostGoodbye = 4096;
  proto::Envelope message;
  if (envelope.size() > kMostGoodbye || !wire::decode_envelope(envelope, message).ok() ||
      !message.has_goodbye())
    return;
  why_ = message.goodbye().text();
  if (message.goodbye().reason() != proto::GOODBYE_CODE_WRONG) return;
  ++bridge_.counters.wrong_codes;
  bridge_.limiter.record_wrong_try(browser_->peer_address(), monotonic_ns());
}

asio::awaitable<void> Watcher::relay_down() {
  while (!is_cut_) {
    const bool is_read = co_await link_.read(body_);
    if (!is_read) break;
    note_refusal(body_);
    ++bridge_.counters.messages_down;
    bridge_.counters.bytes_down += body_.size();
    const bool is_written = co_await browser_->write(body_);
    if (!is_written) break;
  }
}

asio::awaitable<bool> Watcher::send_up(BytesView envelope) {
  upward_.resize(wire::kHeaderBytes + envelope.size());
  const auto length = static_cast<std::uint32_t>(envelope.size());
  std::memcpy(upward_.data(), &length, sizeof length);
  std::copy(envelope.begin(), envelope.end(), upward_.begin() + wire::kHeaderBytes);
  const BytesView framed(upward_);
  const bool is_sent = co_await link_.write(framed);
  ++bridge_.counters.messages_up;
  bridge_.counters.bytes_up += envelope.size();
  co_return is_sent;
}

// A page that says that it leaves is said to leave; one that is lost may come back, so that the
// session keeps its place.
asio::awaitable<void> Watcher::relay_up() {
  while (!is_cut_) {
    const auto message = co_await browser_->read();
    if (message.kind == BrowserMessage::Kind::Closed) {
      const auto frame = wire::encode_bye("the page was closed");
      const BytesView body = BytesView(*frame).subspan(wire::kHeaderBytes);
      co_await send_up(body);
      break;
    }
    if (message.kind != BrowserMessage::Kind::Binary) break;
    proto::Envelope envelope;
    if (!read_page_message(message.bytes, request_.role, envelope)) {
      why_ = "its page said something that a page may not say";
      break;
    }
    const BytesView body(message.bytes);
    const bool is_sent = co_await send_up(body);
    if (!is_sent) break;
  }
  link_.cut();
}

}  // namespace trocar::page
