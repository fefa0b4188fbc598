#include "server/watch/follow/conversation.h"

#include "common/base/no_throw.h"
#include "common/base/spawn.h"
#include "common/base/timing.h"
#include "proto/wire.pb.h"

namespace trocar::follow {
namespace {

// Guests wait earlier than acknowledgements are left out.
constexpr std::size_t kRoomBytes = Conversation::kMostUpwardBytes / 2;
constexpr auto kNever = asio::steady_timer::time_point::max();

}  // namespace

Conversation::Conversation(asio::any_io_executor executor, Sessions& sessions,
                           ConversationOptions options, Take take)
    : executor_(std::move(executor)),
      sessions_(sessions),
      options_(options),
      take_(std::move(take)),
      has_room_(executor_, kNever),
      has_mail_(executor_, kNever),
      next_ping_(executor_),
      talkers_ended_(executor_, kNever) {}

// Coroutines here hold no temporaries across a co_await: GCC 12 miscompiles some of them otherwise.
asio::awaitable<bool> Conversation::open(const SessionAddress& session) {
  upward_.clear();
  upward_bytes_ = 0;
  link_.emplace(executor_, sessions_);
  is_open_ = co_await link_->open(session);
  why_ = is_open_ ? "it closed the connection" : link_->why();
  co_return is_open_;
}

asio::awaitable<void> Conversation::talk() {
  clock_ = {};
  is_pinging_ = false;
  heard_ns_ = monotonic_ns();
  spawn_talker(write_all());
  spawn_talker(watch_time());
  co_await read_all();
  is_open_ = false;
  cut();
  while (talkers_ > 0) co_await talkers_ended_.async_wait(kNoThrow);
}

void Conversation::spawn_talker(asio::awaitable<void> work) {
  ++talkers_;
  spawn(executor_, std::move(work), [this](std::exception_ptr failure) {
    --talkers_;
    talkers_ended_.cancel();
    rethrow(failure);
  });
}

void Conversation::cut() {
  if (link_) link_->cut();
  has_room_.cancel();
  has_mail_.cancel();
  next_ping_.cancel();
}

void Conversation::finish() {
  is_finishing_ = true;
  has_mail_.cancel();
  next_ping_.cancel();
}

void Conversation::begin_pings() {
  if (!std::exchange(is_pinging_, true)) next_ping_.cancel();
}

void Conversation::say(wire::SharedBytes framed) {
  if (!is_open_ || upward_bytes_ > kMostUpwardBytes) return;
  upward_bytes_ += framed->size();
  upward_.push_back(std::move(framed));
  has_mail_.cancel();
}

asio::awaitable<bool> Conversation::await_room() {
  while (is_open_ && upward_bytes_ > kRoomBytes) co_await has_room_.async_wait(kNoThrow);
  co_return is_open_;
}

asio::awaitable<void> Conversation::write_all() {
  while (is_open_) {
    if (upward_.empty()) {
      if (is_finishing_) break;
      co_await has_mail_.async_wait(kNoThrow);
      continue;
    }
    const auto next = upward_.front();
    upward_.pop_front();
    const BytesView bytes(*next);
    const bool is_written = co_await link_->write(bytes);
    upward_bytes_ -= next->size();
    has_room_.cancel();
    if (!is_written) break;
  }
  link_->cut();
}

asio::awaitable<void> Conversation::watch_time() {
  while (is_open_ && !is_finishing_) {
    const auto silence = std::chrono::nanoseconds(monotonic_ns() - heard_ns_);
    if (options_.silence.count() > 0 && silence > options_.silence) {
      why_ = "it is silent";
      link_->cut();
      break;
    }
    if (is_pinging_) {
      proto::Envelope ping;
      ping.mutable_ping()->set_client_time_us(monotonic_ns() / 1000);
      say(ping);
    }
    next_ping_.expires_after(options_.ping_interval);
    co_await next_ping_.async_wait(kNoThrow);
  }
}

asio::awaitable<void> Conversation::read_all() {
  Bytes body;
  while (!is_finishing_) {
    const bool is_read = co_await link_->read(body);
    if (!is_read || is_finishing_ || !heed(body)) break;
  }
}

bool Conversation::heed(const Bytes& body) {
  heard_ns_ = monotonic_ns();
  proto::Envelope message;
  if (const auto decoded = wire::decode_envelope(body, message); !decoded) {
    why_ = decoded.error().message;
    return false;
  }
  if (!message.has_pong()) return take_(message, body);
  clock_.add(message.pong().client_time_us(), message.pong().server_time_us(), heard_ns_ / 1000);
  return true;
}

}  // namespace trocar::follow
