#pragma once

// Whoever serves a session or follows one says who joins, why it ends, and what time it is.
// Each is one framed, encoded, immutable buffer.

#include <cstdint>
#include <span>
#include <string>

#include "common/base/bytes.h"
#include "common/base/tick.h"
#include "common/tool/tool.h"
#include "common/wire/framing.h"
#include "common/wire/role.h"

namespace trocar::wire {

// Values of proto::GoodbyeReason, here so that headers need no generated code.
enum class EndReason : std::uint8_t {
  Unspecified = 0,
  ServerClosing = 1,
  ProtocolError = 2,
  Version = 3,
  Full = 4,
  NameTaken = 5,
  Role = 6,
  TooSlow = 7,
  Timeout = 8,
  CodeWrong = 9,
  CodeExpired = 10,
  CodeUsedUp = 11,
  CodeRevoked = 12,
  TooManyTries = 13,
  CodeRole = 14,
  NameInvalid = 15,
  PutOut = 16,
  Closed = 17,
};
inline constexpr int kEndReasonCount = 18;
// In words for figures, such as "code-wrong".
const char* name_of(EndReason reason);

inline constexpr std::uint32_t kMostRelayed = 100'000;  // people who watch through one relay

struct Hello {
  std::string name;
  Role role = Role::Observer;
  BytesView join_secret;   // of a join code; empty: none
  BytesView return_token;  // of the Welcome before; empty: none
  std::span<const tool::ToolShape> tools;
  bool acks_every_frame = true;
  bool can_return = true;
  bool relays = false;
};

SharedBytes encode_hello(const Hello& hello);
SharedBytes encode_goodbye(EndReason reason, const std::string& text);
SharedBytes encode_bye(const std::string& reason);
SharedBytes encode_pong(std::uint64_t client_time_us, Tick tick, std::uint64_t server_time_us);

}  // namespace trocar::wire
