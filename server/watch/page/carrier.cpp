#include "server/watch/page/carrier.h"

#include "common/base/log.h"
#include "common/base/no_throw.h"
#include "common/base/printable.h"
#include "common/base/spawn.h"
#include "common/wire/session_messages.h"
#include "proto/wire.pb.h"
#include "server/watch/page/page_messages.h"

namespace trocar::page {
namespace {

constexpr auto kNever = asio::steady_timer::time_point::max();
constexpr std::chrono::milliseconds kAttentionPeriod{50};
// A page acknowledges 63 frames a second, and moves each of two hands 125 times.
constexpr std::uint32_t kMostMessagesPerSecond = 600;

// A frame or two may wait for a browser's socket: the next one is newer.
replication::ReplicatorOptions limits_of_pages() {
  replication::ReplicatorOptions limits;
  limits.max_messages_per_second = kMostMessagesPerSecond;
  limits.skip_above_bytes = 0;
  return limits;
}

}  // namespace

Carrier::Carrier(asio::any_io_executor executor, follow::Sessions& sessions, PageCounters& counters,
                 follow::SessionAddress session)
    : Show(*this, limits_of_pages(), counters.frames,
           [this](const auto& message) { conversation_.say(message); }),
      executor_(executor),
      sessions_(sessions),
      counters_(counters),
      session_(std::move(session)),
      conversation_(
          std::move(executor), sessions, {},
          [this](const auto& message, const auto& body) { return take_any(message, body); }),
      changed_(executor_, kNever),
      attention_(executor_) {}

Carrier::~Carrier() = default;

void Carrier::start() {
  const auto self = shared_from_this();
  spawn(executor_, run(), [self](std::exception_ptr failure) { rethrow(failure); });
}

// Coroutines here hold no temporaries across a co_await: GCC 12 miscompiles some of them otherwise.
asio::awaitable<void> Carrier::run() {
  const bool is_open = co_await conversation_.open(session_);
  if (!is_open || state_ == State::Ended) {
    ++counters_.unreachable;
    why_ = conversation_.why();
    end();
    co_return;
  }
  state_ = State::Open;
  ++counters_.carriers;
  changed_.cancel();
  attend();
  co_await conversation_.talk();
  --counters_.carriers;
  end();
}

void Carrier::end() {
  if (state_ == State::Ended) return;
  state_ = State::Ended;
  conversation_.cut();
  changed_.cancel();
  attention_.cancel();
  for (const auto& [number, seat] : seats_) seat->lose();
}

void Carrier::attend() {
  attention_.expires_after(kAttentionPeriod);
  attention_.async_wait([self = shared_from_this()](boost::system::error_code error) {
    if (error || self->state_ == State::Ended) return;
    self->give_all();
    self->attend();
  });
}

asio::awaitable<bool> Carrier::reach() {
  while (state_ == State::Reaching) co_await changed_.async_wait(kNoThrow);
  co_return state_ == State::Open;
}

// ---- the seats ----

std::uint32_t Carrier::add(Carried& seat) {
  seats_[next_number_] = &seat;
  viewers().on_open(next_number_);
  viewers().find(next_number_)->feed.pace();
  return next_number_++;
}

void Carrier::remove(std::uint32_t number) {
  seats_.erase(number);
  viewers().on_close(number);
}

bool Carrier::send(net::ConnectionId seat, wire::SharedBytes framed) {
  const auto found = seats_.find(seat);
  return found != seats_.end() && found->second->tell(framed);
}

std::size_t Carrier::outstanding_bytes(net::ConnectionId seat) const {
  const auto found = seats_.find(seat);
  return found == seats_.end() ? 0 : found->second->waiting_bytes();
}

// A page comes back by itself, and to a fresh picture, where no Goodbye tells it not to.
void Carrier::forget(const replication::Viewer& who, const replication::Ending* ending) {
  const auto found = seats_.find(who.id);
  if (ending && found != seats_.end()) found->second->cut_off(ending->text);
}

// ---- to the session ----

void Carrier::say_for(std::uint32_t number, BytesView envelope, bool is_last) {
  proto::Envelope message;
  auto& guest = *message.mutable_guest_message();
  guest.set_guest(number);
  guest.set_envelope(envelope.data(), envelope.size());
  guest.set_is_last(is_last);
  conversation_.say(message);
}

asio::awaitable<bool> Carrier::say(std::uint32_t number, BytesView envelope, bool is_last) {
  const bool has_room = co_await conversation_.await_room();
  if (has_room) say_for(number, envelope, is_last);
  co_return has_room;
}

asio::awaitable<bool> Carrier::heed_page(std::uint32_t number, BytesView envelope) {
  const bool has_room = co_await conversation_.await_room();
  if (has_room) viewers().on_message(number, envelope);
  co_return has_room;
}

std::optional<replication::Ending> Carrier::heed(replication::Viewer& who,
                                                 const proto::Envelope& message) {
  const auto envelope = message.SerializeAsString();
  say_for(static_cast<std::uint32_t>(who.id), bytes_of(std::string_view(envelope)), false);
  return std::nullopt;
}

// The session wants to hear of its last frame from everybody.
void Carrier::note_shown(const replication::Viewer& who, const proto::FrameAck& ack) {
  if (copy().last_frame() != ack.frame()) return;
  proto::Envelope message;
  *message.mutable_frame_ack() = ack;
  const auto envelope = message.SerializeAsString();
  say_for(static_cast<std::uint32_t>(who.id), bytes_of(std::string_view(envelope)), false);
}

std::uint64_t Carrier::server_time_us() const {
  return conversation_.clock().at(limits().clock_ns() / 1000);
}

// ---- from the session ----

bool Carrier::take_any(const proto::Envelope& message, const Bytes& body) {
  if (message.has_guest_message()) {
    take_for_guest(message.guest_message());
    return true;
  }
  if (message.has_goodbye()) {
    say_goodbye(message.goodbye());
    return false;
  }
  is_carrying_ = true;
  conversation_.begin_pings();
  const auto taken = take(message, wire::frame_body(body));
  if (!taken)
    log::warn("the session at {} says what cannot be: {}", session_.name,
              printable(taken.error().message, 200));
  return taken.ok();
}

void Carrier::take_for_guest(const proto::GuestMessage& guest) {
  const auto found = seats_.find(guest.guest());
  if (found == seats_.end()) return;
  auto& seat = *found->second;
  const auto envelope = bytes_of(std::string_view(guest.envelope()));
  proto::Envelope message;
  if (!envelope.empty() && wire::decode_envelope(envelope, message).ok()) {
    seat.take(message);
    auto* viewer = viewers().find(guest.guest());
    if (message.has_welcome() && viewer && !viewer->is_welcome) {
      for (const auto& address : message.welcome().further_address())
        sessions_.note_further(session_.name, conversation_.code(), address);
      if (const auto ending =
              viewers().welcome(*viewer, wire::encode_envelope(message), has_picture()))
        viewers().end(guest.guest(), *ending);
    } else {
      send(guest.guest(), wire::encode_envelope(message));
    }
  }
  if (guest.is_last()) seat.finish_after_words();
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
  proto::Envelope words;
  *words.mutable_goodbye() = goodbye;
  words.mutable_goodbye()->set_text(why_);
  for (const auto& [number, seat] : seats_) {
    seat->take(words);
    seat->tell(wire::encode_envelope(words));
    seat->finish_after_words();
  }
}

net::ConnectionId Carrier::but(const proto::Envelope& message) const {
  if (!message.has_view_event()) return 0;
  for (const auto& [number, seat] : seats_)
    if (seat->slot() == message.view_event().participant()) return number;
  return 0;
}

}  // namespace trocar::page
