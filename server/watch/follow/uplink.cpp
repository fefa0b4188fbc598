#include "server/watch/follow/uplink.h"

#include "common/base/backoff.h"
#include "common/base/log.h"
#include "common/base/no_throw.h"
#include "common/base/printable.h"
#include "common/base/spawn.h"
#include "common/base/timing.h"
#include "common/base/version.h"
#include "common/wire/session_messages.h"
#include "proto/wire.pb.h"

namespace trocar::follow {
namespace {

using wire::EndReason;

constexpr int kMostNames = 9;
constexpr std::chrono::milliseconds kPingInterval{500}, kFirstPause{200}, kLongestPause{2000};

}  // namespace

Uplink::Uplink(asio::any_io_executor executor, UplinkOptions options)
    : Follower(monotonic_ns),
      executor_(std::move(executor)),
      options_(std::move(options)),
      sessions_({options_.server}),
      conversation_(
          executor_, sessions_,
          {.ping_interval = kPingInterval, .silence = std::chrono::nanoseconds(kSilenceNs)},
          [this](const auto& message, const auto& body) { return take(message, body); }),
      pause_(executor_) {}

Uplink::~Uplink() = default;

void Uplink::start(UpstreamEvents events) {
  begin(std::move(events));
  spawn(executor_, run(), [](std::exception_ptr failure) { rethrow(failure); });
}

void Uplink::stop() {
  if (!finish()) return;
  pause_.cancel();
  if (!is_welcome()) return cut();
  proto::Envelope bye;
  bye.mutable_bye()->set_reason("the relay ends");
  say(bye);
  conversation_.finish();
}

std::string Uplink::name_there() const {
  return number_ == 1 ? options_.name : options_.name + " " + std::to_string(number_);
}

// Coroutines here hold no temporaries across a co_await: GCC 12 miscompiles some of them otherwise.
asio::awaitable<void> Uplink::run() {
  Backoff pause(kFirstPause, kLongestPause, 1.5);
  while (!is_over()) {
    const bool is_open = co_await conversation_.open(options_.server);
    if (is_over()) break;
    if (is_open && conversation_.code() != options_.code.certificate) {
      end(EndReason::CodeWrong, options_.server.name +
                                    " is not the server of this join code: check the code's first "
                                    "eight characters and the address");
      break;
    }
    if (is_open) {
      say_hello();
      co_await conversation_.talk();
    } else {
      say_waiting();
    }
    if (is_over()) break;
    if (lose(conversation_.why())) pause.restart();
    if (is_too_late()) {
      end(EndReason::ServerClosing, conversation_.why());
      break;
    }
    pause_.expires_after(pause.next());
    co_await pause_.async_wait(kNoThrow);
  }
}

// Once, and not to who was in the session before.
void Uplink::say_waiting() {
  if (was_welcome() || std::exchange(has_said_waiting_, true)) return;
  log::info("no server at {} yet ({}): trying for {} s", options_.server.name, conversation_.why(),
            kReachNs / 1'000'000'000);
}

void Uplink::say_hello() {
  conversation_.say(wire::encode_hello({.name = name_there(),
                                        .join_secret = options_.code.secret,
                                        .return_token = bytes_of(std::string_view(token_)),
                                        .relays = true}));
}

bool Uplink::take(const proto::Envelope& message, const Bytes& body) {
  if (message.has_welcome()) {
    token_ = message.welcome().return_token();
    conversation_.begin_pings();
    return take_welcome(message.welcome());
  }
  if (message.has_goodbye()) return take_goodbye(message.goodbye());
  if (!is_welcome()) return true;
  const auto taken = hand_on(message, wire::frame_body(body));
  if (!taken) conversation_.explain(printable(taken.error().message, 200));
  return taken.ok();
}

// Returns false always. Reasons that end this connection alone are no end of the session.
bool Uplink::take_goodbye(const proto::Goodbye& goodbye) {
  conversation_.explain(printable(goodbye.text(), 200));
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
      if (is_welcome()) return false;
      break;
    case proto::GOODBYE_FULL:
    case proto::GOODBYE_CLOSED:
      if (was_welcome()) return false;
      break;
    default:
      break;
  }
  const auto reason = static_cast<int>(goodbye.reason());
  end(reason > 0 && reason < wire::kEndReasonCount ? static_cast<EndReason>(reason)
                                                   : EndReason::Unspecified,
      conversation_.why());
  return false;
}

}  // namespace trocar::follow
