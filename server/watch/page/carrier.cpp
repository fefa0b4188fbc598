#include "server/watch/page/carrier.h"

#include <boost/asio/detached.hpp>

#include "common/base/log.h"
#include "common/base/no_throw.h"
#include "common/base/printable.h"
#include "common/base/spawn.h"
#include "common/base/timing.h"
#include "proto/wire.pb.h"
#include "server/watch/page/page_messages.h"

namespace trocar::page {
namespace {

using follow::News;

constexpr std::size_t kMostUpwardBytes = 256 * 1024;
constexpr std::chrono::milliseconds kPingInterval{1000};
constexpr auto kNever = asio::steady_timer::time_point::max();

}  // namespace

Carrier::Carrier(asio::any_io_executor executor, follow::Sessions& sessions, PageCounters& counters,
                 follow::SessionAddress session)
    : executor_(executor),
      sessions_(sessions),
      counters_(counters),
      session_(std::move(session)),
      link_(executor, sessions),
      changed_(executor, kNever),
      has_mail_(executor, kNever),
      next_ping_(executor) {}

Carrier::~Carrier() = default;

void Carrier::start() {
  spawn(run());
}

void Carrier::spawn(asio::awaitable<void> work) {
  const auto self = shared_from_this();
  trocar::spawn(executor_, std::move(work),
                [self](std::exception_ptr failure) { rethrow(failure); });
}

// Coroutines here hold no temporaries across a co_await: GCC 12 miscompiles some of them otherwise.
asio::awaitable<void> Carrier::run() {
  const bool is_open = co_await link_.open(session_);
  if (!is_open || state_ == State::Ended) {
    ++counters_.unreachable;
    why_ = link_.why();
    end();
    co_return;
  }
  state_ = State::Open;
  ++counters_.carriers;
  changed_.cancel();
  spawn(write_all());
  spawn(ping_often());
  co_await read_all();
  --counters_.carriers;
  end();
}

void Carrier::end() {
  if (state_ == State::Ended) return;
  state_ = State::Ended;
  link_.cut();
  changed_.cancel();
  has_mail_.cancel();
  next_ping_.cancel();
  for (const auto& [number, seat] : seats_) seat->lose();
}

asio::awaitable<bool> Carrier::reach() {
  while (state_ == State::Reaching) co_await changed_.async_wait(kNoThrow);
  co_return state_ == State::Open;
}

std::uint32_t Carrier::add(Carried& seat) {
  seats_[next_number_] = &seat;
  return next_number_++;
}

void Carrier::remove(std::uint32_t number) {
  seats_.erase(number);
}

asio::awaitable<bool> Carrier::say(std::uint32_t number, BytesView envelope, bool is_last) {
  proto::Envelope message;
  auto& guest = *message.mutable_guest_message();
  guest.set_guest(number);
  guest.set_envelope(envelope.data(), envelope.size());
  guest.set_is_last(is_last);
  while (state_ == State::Open && upward_bytes_ > kMostUpwardBytes)
    co_await changed_.async_wait(kNoThrow);
  if (state_ != State::Open) co_return false;
  queue(message);
  co_return true;
}

void Carrier::note_further(const proto::Welcome& welcome) {
  for (const auto& address : welcome.further_address())
    sessions_.note_further(session_.name, link_.code(), address);
}

void Carrier::queue(const proto::Envelope& message) {
  upward_.push_back(wire::encode_envelope(message));
  upward_bytes_ += upward_.back()->size();
  has_mail_.cancel();
}

asio::awaitable<void> Carrier::write_all() {
  while (state_ == State::Open) {
    if (upward_.empty()) {
      co_await has_mail_.async_wait(kNoThrow);
      continue;
    }
    const auto next = upward_.front();
    upward_.pop_front();
    const BytesView bytes(*next);
    const bool is_written = co_await link_.write(bytes);
    upward_bytes_ -= next->size();
    changed_.cancel();
    if (!is_written) break;
  }
  end();
}

asio::awaitable<void> Carrier::ping_often() {
  while (state_ == State::Open) {
    // The session hears what a guest says first.
    if (is_carrying_) {
      proto::Envelope ping;
      ping.mutable_ping()->set_client_time_us(monotonic_ns() / 1000);
      queue(ping);
    }
    next_ping_.expires_after(kPingInterval);
    co_await next_ping_.async_wait(kNoThrow);
  }
}

asio::awaitable<void> Carrier::read_all() {
  Bytes body;
  while (state_ == State::Open) {
    const bool is_read = co_await link_.read(body);
    if (!is_read || !take(body)) break;
  }
}

bool Carrier::take(const Bytes& body) {
  proto::Envelope message;
  if (!wire::decode_envelope(body, message).ok()) return false;
  switch (message.message_case()) {
    case proto::Envelope::kGuestMessage: {
      const auto& guest = message.guest_message();
      const auto seat = seats_.find(guest.guest());
      if (seat != seats_.end())
        seat->second->take(bytes_of(std::string_view(guest.envelope())), guest.is_last());
      return true;
    }
    case proto::Envelope::kPong:
      clock_.note(message.pong().client_time_us(), monotonic_ns() / 1000,
                  message.pong().server_time_us());
      return true;
    case proto::Envelope::kGoodbye:
      say_goodbye(message.goodbye());
      return false;
    default:
      if (!std::exchange(is_carrying_, true)) next_ping_.cancel();
      return spread(message, wire::frame_body(body));
  }
}

// The pages survive what ends this connection alone: they come back over the next one.
void Carrier::say_goodbye(const proto::Goodbye& goodbye) {
  const bool is_old = !is_carrying_ && goodbye.reason() == proto::GOODBYE_PROTOCOL_ERROR;
  why_ =
      is_old ? "the server is older than this page: use the same release for both" : goodbye.text();
  log::warn("the session at {} ends the connection: {}", session_.name, printable(why_, 200));
  const bool is_lost = goodbye.reason() == proto::GOODBYE_TOO_SLOW ||
                       goodbye.reason() == proto::GOODBYE_TIMEOUT ||
                       goodbye.reason() == proto::GOODBYE_PROTOCOL_ERROR;
  if (is_lost && !is_old) return;
  const auto words = encode_goodbye(goodbye.reason(), why_);
  for (const auto& [number, seat] : seats_)
    seat->take(BytesView(*words).subspan(wire::kHeaderBytes), true);
}

bool Carrier::spread(const proto::Envelope& message, const wire::SharedBytes& bytes) {
  const auto news = copy_.take(message, bytes);
  if (!news) {
    log::warn("the session at {} says what cannot be: {}", session_.name,
              printable(news.error().message, 200));
    return false;
  }
  if (*news == News::Frame && message.has_surface_frame()) {
    proto::Envelope ack;
    ack.mutable_frame_ack()->set_frame(copy_.frame());
    ack.mutable_frame_ack()->set_surface_crc(copy_.surface_crc());
    queue(ack);
  }
  if (copy_.needs_keyframe()) {
    proto::Envelope request;
    request.mutable_keyframe_request();
    queue(request);
  }
  if (*news == News::Nothing) return true;
  const bool is_view = message.has_view_event();
  for (const auto& [number, seat] : seats_)
    if (!is_view || seat->slot() != message.view_event().participant()) seat->hear(*news, bytes);
  return true;
}

}  // namespace trocar::page
