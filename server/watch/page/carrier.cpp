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

using follow::News;

constexpr auto kNever = asio::steady_timer::time_point::max();

}  // namespace

Carrier::Carrier(asio::any_io_executor executor, follow::Sessions& sessions, PageCounters& counters,
                 follow::SessionAddress session)
    : executor_(executor),
      sessions_(sessions),
      counters_(counters),
      session_(std::move(session)),
      conversation_(std::move(executor), sessions, {},
                    [this](const auto& message, const auto& body) { return take(message, body); }),
      changed_(executor_, kNever) {}

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
  co_await conversation_.talk();
  --counters_.carriers;
  end();
}

void Carrier::end() {
  if (state_ == State::Ended) return;
  state_ = State::Ended;
  conversation_.cut();
  changed_.cancel();
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
  const bool has_room = co_await conversation_.await_room();
  if (has_room) conversation_.say(message);
  co_return has_room;
}

void Carrier::note_further(const proto::Welcome& welcome) {
  for (const auto& address : welcome.further_address())
    sessions_.note_further(session_.name, conversation_.code(), address);
}

bool Carrier::take(const proto::Envelope& message, const Bytes& body) {
  switch (message.message_case()) {
    case proto::Envelope::kGuestMessage: {
      const auto& guest = message.guest_message();
      const auto seat = seats_.find(guest.guest());
      if (seat != seats_.end())
        seat->second->take(bytes_of(std::string_view(guest.envelope())), guest.is_last());
      return true;
    }
    case proto::Envelope::kGoodbye:
      say_goodbye(message.goodbye());
      return false;
    default:
      is_carrying_ = true;
      conversation_.begin_pings();
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
  const auto words = wire::encode_goodbye(static_cast<wire::EndReason>(goodbye.reason()), why_);
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
  if (*news == News::Frame) {
    proto::Envelope ack;
    copy_.acknowledge(*ack.mutable_frame_ack());
    conversation_.say(ack);
  }
  if (copy_.needs_keyframe()) {
    proto::Envelope request;
    request.mutable_keyframe_request();
    conversation_.say(request);
  }
  if (*news == News::Nothing) return true;
  const bool is_view = message.has_view_event();
  for (const auto& [number, seat] : seats_)
    if (!is_view || seat->slot() != message.view_event().participant()) seat->hear(*news, bytes);
  return true;
}

}  // namespace trocar::page
