#include "server/watch/page/watcher.h"

#include "common/base/log.h"
#include "common/base/printable.h"
#include "common/base/timing.h"

namespace trocar::page {
namespace {

constexpr std::chrono::seconds kJoinDeadline{5};

}  // namespace

Watcher::Watcher(std::unique_ptr<http::WebSocket> browser, Bridge& bridge)
    : browser_(std::move(browser)), bridge_(bridge), join_deadline_(browser_->executor()) {}

void Watcher::cut() {
  is_cut_ = true;
  browser_->cut();
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
    const follow::SessionAddress place = *session;  // which may go meanwhile
    co_await watch(place);
    log::info("{} from {} has left{}{}", printable(request_.name, 64), address,
              why_.empty() ? "" : ": ", printable(why_, 200));
  }
  co_await browser_->close();
  cut();
  if (seat_) co_await seat_->finish();
}

asio::awaitable<bool> Watcher::read_join() {
  const auto first = co_await browser_->read();
  if (first.kind != http::WebMessage::Kind::Text) co_return false;
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

asio::awaitable<bool> Watcher::find_place(const std::string& address) {
  const auto place = bridge_.observers.place_for(address);
  if (place == intake::Room::Place::Free) co_return true;
  ++bridge_.counters.refused;
  why_ = place == intake::Room::Place::AllFull
             ? "full: all places of this page for observers are taken, come back later"
             : "full: all places for observers from your address are taken, come back later";
  std::string text = why_;
  co_await refuse(reason_to_wait(request_, wire::EndReason::Full), std::move(text));
  co_return false;
}

asio::awaitable<void> Watcher::watch(const follow::SessionAddress& session) {
  const bool is_observer = request_.role == wire::Role::Observer;
  const auto address = browser_->peer_address();
  if (is_observer) {
    const bool has_place = co_await find_place(address);
    if (!has_place) co_return;
    bridge_.observers.enter(address);
  }
  seat_ = std::make_shared<Seat>(*browser_, bridge_, request_);
  if (is_cut_) seat_->cut();
  co_await seat_->run(session);
  why_ = seat_->why();
  if (is_observer) bridge_.observers.leave(address);
}

}  // namespace trocar::page
