#pragma once

// Join codes, as people read them over the phone: 16 characters of Crockford's base 32 in four
// groups, such as 7K3M-9QXZ-4T2B-WN8C. The first 8 are 40 bits of the server's certificate
// (certificate.h), which the client checks; the last 8 are 40 random bits, which the server checks.
//
// Reading folds case, O to 0, I and L to 1; hyphens and spaces may stand anywhere.
// A link is trocar://HOST:PORT/CODE.

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace trocar::secure {

using HalfCode = std::array<std::uint8_t, 5>;

struct JoinCode {
  HalfCode certificate{};
  HalfCode secret{};

  bool operator==(const JoinCode&) const = default;
};

std::string to_text(const JoinCode& code);
Result<JoinCode> parse_join_code(std::string_view text);

struct JoinInvitation {
  JoinCode code;
  std::string server;  // "HOST:PORT"; empty if the text was a code alone
};
// `server`: "HOST:PORT", an IPv6 address in brackets.
std::string to_link(const std::string& server, const JoinCode& code);
// Reads a code or a link.
Result<JoinInvitation> parse_invitation(std::string_view text);

}  // namespace trocar::secure
