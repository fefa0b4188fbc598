#include "server/watch/follow/uplink.h"

#include <algorithm>

#include "common/base/log.h"
#include "common/base/no_throw.h"
#include "common/base/printable.h"
#include "common/base/spawn.h"
#include "common/base/timing.h"
#include "common/base/version.h"
#include "proto/wire.pb.h"
#include "server/session/participants/absences.h"

namespace trocar::follow {
namespace {

using replication::EndReason;

constexpr std::size_t kMostUpwardBytes = 256 * 1024;
constexpr int kMostNames = 9;
constexpr std::chrono::milliseconds kPingInterval{500}, kFirstPause{200}, kLongestPause{2000};
constexpr auto kNever = asio::steady_timer::time_point::max();

std::uint64_t ns_of(std::chrono::milliseconds time) {
  return static_cast<std::uint64_t>(time.count()) * 1'000'000;
}

}  // namespace

Uplink::Uplink(asio::any_io_executor executor, UplinkOptions options)
    : executor_(std::move(executor)),
      options_(std::move(options)),
      sessions_({options_.server}),
      pause_(executor_),
      has_mail_(executor_, kNever),
      next_ping_(executor_),
      talkers_ended_(executor_, kNever) {}

Uplink::~Uplink() = default;

void Uplink::start(UpstreamEvents events) {
  events_ = std::move(events);
  deadline_ns_ = monotonic_ns() + ns_of(options_.reach_deadline);
  spawn(executor_, run(), [](std::exception_ptr failure) { rethrow(failure); });
}

void Uplink::stop() {
  if (is_over_) return;
  proto::Envelope bye;
  bye.mutable_bye()->set_reason("the relay ends");
  if (is_welcome_) say(bye);
  is_over_ = true;
  events_ = {};
  pause_.cancel();
  next_ping_.cancel();
  has_mail_.cancel();
  if (!is_welcome_) cut();
}

void Uplink::end(EndReason reason, const std::string& text) {
  if (is_over_) return;
  is_over_ = true;
  cut();
  if (const auto over = std::exchange(events_, {}).over) over(reason, text);
}

void Uplink::cut() {
  if (link_) link_->cut();
  has_mail_.cancel();
  next_ping_.cancel();
}

std::string Uplink::name_there() const {
  return number_ == 1 ? options_.name : options_.name + " " + std::to_string(number_);
}

// Coroutines here hold no temporaries across a co_await: GCC 12 miscompiles some of them otherwise.
asio::awaitable<void> Uplink::run() {
  auto pause = kFirstPause;
  while (!is_over_) {
    link_ = std::make_unique<SessionLink>(executor_, sessions_);
    const bool is_open = co_await link_->open(options_.server);
    if (is_over_) break;
    if (is_open && link_->code() != options_.code.certificate) {
      end(EndReason::CodeWrong, options_.server.name +
                                    " is not the server of this join code: check the code's first "
                                    "eight characters and the address");
      break;
    }
    if (!is_open) {
      why_ = link_->why();
      say_waiting();
    }
    if (is_open) co_await talk();
    if (is_over_) break;
    if (std::exchange(is_welcome_, false)) {
      deadline_ns_ = monotonic_ns() + ns_of(options_.return_deadline);
      pause = kFirstPause;
      log::warn("the connection to {} broke ({}): trying again", options_.server.name, why_);
      if (events_.lost) events_.lost(why_);
    }
    if (monotonic_ns() >= deadline_ns_) {
      end(EndReason::ServerClosing, why_);
      break;
    }
    pause_.expires_after(pause);
    co_await pause_.async_wait(kNoThrow);
    pause = std::min(pause + pause / 2, kLongestPause);
  }
}

// Once, and not to who was in the session before.
void Uplink::say_waiting() {
  if (was_welcome_ || std::exchange(has_said_waiting_, true)) return;
  log::info("no server at {} yet ({}): trying for {} s", options_.server.name, why_,
            std::chrono::ceil<std::chrono::seconds>(options_.reach_deadline).count());
}

asio::awaitable<void> Uplink::talk() {
  upward_.clear();
  upward_bytes_ = 0;
  clock_ = {};
  why_ = "it closed the connection";
  heard_ns_ = monotonic_ns();
  is_talking_ = true;
  say_hello();
  spawn_talker(write_all());
  spawn_talker(ping_often());
  co_await read_all();
  is_talking_ = false;
  cut();
  while (talkers_ > 0) co_await talkers_ended_.async_wait(kNoThrow);
}

void Uplink::spawn_talker(asio::awaitable<void> work) {
  ++talkers_;
  spawn(executor_, std::move(work), [this](std::exception_ptr failure) {
    --talkers_;
    talkers_ended_.cancel();
    rethrow(failure);
  });
}

void Uplink::say_hello() {
  proto::Envelope envelope;
  auto& hello = *envelope.mutable_hello();
  hello.set_protocol_major(kProtocolMajor);
  hello.set_protocol_minor(kProtocolMinor);
  hello.set_name(name_there());
  hello.set_role(proto::ROLE_OBSERVER);
  hello.set_join_secret(options_.code.secret.data(), options_.code.secret.size());
  hello.set_acks_every_frame(true);
  hello.set_can_return(true);
  hello.set_relays(true);
  hello.set_return_token(token_);
  say(envelope);
}

void Uplink::say(const proto::Envelope& message) {
  if (!is_talking_ || upward_bytes_ > kMostUpwardBytes) return;
  upward_.push_back(wire::encode_envelope(message));
  upward_bytes_ += upward_.back()->size();
  has_mail_.cancel();
}

asio::awaitable<void> Uplink::write_all() {
  while (is_talking_) {
    if (upward_.empty()) {
      if (is_over_) break;  // Bye is said
      co_await has_mail_.async_wait(kNoThrow);
      continue;
    }
    const auto next = upward_.front();
    upward_.pop_front();
    const BytesView bytes(*next);
    const bool is_written = co_await link_->write(bytes);
    upward_bytes_ -= std::min(upward_bytes_, next->size());
    if (!is_written) break;
  }
  link_->cut();
}

asio::awaitable<void> Uplink::ping_often() {
  while (is_talking_ && !is_over_) {
    if (monotonic_ns() - heard_ns_ > ns_of(options_.silence)) {
      why_ = "it is silent";
      link_->cut();
      break;
    }
    if (is_welcome_) {
      proto::Envelope ping;
      ping.mutable_ping()->set_client_time_us(monotonic_ns() / 1000);
      say(ping);
    }
    next_ping_.expires_after(kPingInterval);
    co_await next_ping_.async_wait(kNoThrow);
  }
}

asio::awaitable<void> Uplink::read_all() {
  Bytes body;
  while (is_talking_ && !is_over_) {
    const bool is_read = co_await link_->read(body);
    if (!is_read || is_over_ || !take(body)) break;
  }
}

bool Uplink::take(const Bytes& body) {
  heard_ns_ = monotonic_ns();
  proto::Envelope message;
  if (const auto decoded = wire::decode_envelope(body, message); !decoded) {
    why_ = decoded.error().message;
    return false;
  }
  switch (message.message_case()) {
    case proto::Envelope::kWelcome:
      if (message.welcome().protocol_major() != kProtocolMajor) {
        end(EndReason::Version, "the server speaks another protocol: use programs of one release");
        return false;
      }
      take_welcome(message.welcome());
      return true;
    case proto::Envelope::kPong:
      clock_.note(message.pong().client_time_us(), monotonic_ns() / 1000,
                  message.pong().server_time_us());
      return true;
    case proto::Envelope::kGoodbye:
      return take_goodbye(message.goodbye());
    default:
      break;
  }
  const auto hand_on = events_.message;  // a copy: it may stop this
  if (!is_welcome_ || !hand_on) return true;
  const auto taken = hand_on(message, wire::frame_body(body));
  if (!taken) why_ = printable(taken.error().message, 200);
  return taken.ok();
}

void Uplink::take_welcome(const proto::Welcome& welcome) {
  is_welcome_ = true;
  if (std::exchange(was_welcome_, true)) ++returns_;
  const bool has_token = welcome.return_token().size() == participants::kReturnTokenBytes;
  token_ = has_token ? welcome.return_token() : std::string();
  next_ping_.cancel();
  if (const auto hand_on = events_.welcome) hand_on(welcome);
}

// Returns false always. Reasons that end this connection alone are no end of the session.
bool Uplink::take_goodbye(const proto::Goodbye& goodbye) {
  why_ = printable(goodbye.text(), 200);
  switch (goodbye.reason()) {
    case proto::GOODBYE_NAME_TAKEN:
      token_.clear();
      if (number_++ < kMostNames) return false;
      break;
    case proto::GOODBYE_TOO_SLOW:
    case proto::GOODBYE_TIMEOUT:
    case proto::GOODBYE_TOO_MANY_TRIES:
      return false;
    case proto::GOODBYE_PROTOCOL_ERROR:
      if (is_welcome_) return false;
      break;
    case proto::GOODBYE_FULL:
    case proto::GOODBYE_CLOSED:
      if (was_welcome_) return false;
      break;
    default:
      break;
  }
  const auto reason = static_cast<int>(goodbye.reason());
  end(reason > 0 && reason < replication::kEndReasonCount ? static_cast<EndReason>(reason)
                                                          : EndReason::Unspecified,
      why_);
  return false;
}

}  // namespace trocar::follow
