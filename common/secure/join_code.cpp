#include "common/secure/join_code.h"

#include <vector>

namespace trocar::secure {
namespace {

constexpr std::string_view kLetters = "0123456789ABCDEFGHJKMNPQRSTVWXYZ";
constexpr std::string_view kScheme = "trocar://";
constexpr std::size_t kCharacters = 16, kGroup = 4;
constexpr int kBitsPerCharacter = 5;
constexpr std::size_t kLongestServer = 255 + 6;  // a host name and a port

Error bad(const std::string& what) {
  return {ErrorCode::Usage,
          "join code: " + what + ": it has four groups of four, such as 7K3M-9QXZ-4T2B-WN8C"};
}

char folded(char c) {
  if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  if (c == 'O') return '0';
  return c == 'I' || c == 'L' ? '1' : c;
}

void append_half(const HalfCode& half, std::string& text) {
  std::uint64_t bits = 0;
  for (const auto byte : half) bits = bits << 8 | byte;
  for (int shift = 35; shift >= 0; shift -= kBitsPerCharacter) text += kLetters[bits >> shift & 31];
}

HalfCode read_half(const std::vector<std::uint8_t>& values, std::size_t first) {
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < kCharacters / 2; ++i)
    bits = bits << kBitsPerCharacter | values[first + i];
  HalfCode half{};
  for (std::size_t i = half.size(); i-- > 0; bits >>= 8)
    half[i] = static_cast<std::uint8_t>(bits & 0xff);
  return half;
}

}  // namespace

std::string to_text(const JoinCode& code) {
  std::string letters, text;
  append_half(code.certificate, letters);
  append_half(code.secret, letters);
  for (std::size_t i = 0; i < letters.size(); ++i) {
    if (i > 0 && i % kGroup == 0) text += '-';
    text += letters[i];
  }
  return text;
}

Result<JoinCode> parse_join_code(std::string_view text) {
  std::vector<std::uint8_t> values;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '-' || text[i] == ' ') continue;
    const auto value = kLetters.find(folded(text[i]));
    // A character that cannot be printed is not printed.
    if (value == std::string_view::npos)
      return bad("character " + std::to_string(i + 1) + " is none of 0-9 and A-Z without U");
    if (values.size() == kCharacters) return bad("it has more than 16 characters");
    values.push_back(static_cast<std::uint8_t>(value));
  }
  if (values.size() != kCharacters)
    return bad("it has " + std::to_string(values.size()) + " characters instead of 16");
  return JoinCode{read_half(values, 0), read_half(values, kCharacters / 2)};
}

std::string to_link(const std::string& server, const JoinCode& code) {
  return std::string(kScheme) + server + "/" + to_text(code);
}

Result<JoinInvitation> parse_invitation(std::string_view text) {
  JoinInvitation invitation;
  if (text.starts_with(kScheme)) {
    text.remove_prefix(kScheme.size());
    const auto slash = text.find('/');
    if (slash == std::string_view::npos || slash == 0 || slash > kLongestServer)
      return Error{ErrorCode::Usage, "join link: it is not trocar://HOST:PORT/CODE"};
    for (const char c : text.substr(0, slash))
      if (c <= ' ' || c > '~')
        return Error{ErrorCode::Usage, "join link: its host has a character that no host has"};
    invitation.server = text.substr(0, slash);
    text.remove_prefix(slash + 1);
  }
  const auto code = parse_join_code(text);
  if (!code) return code.error();
  invitation.code = *code;
  return invitation;
}

}  // namespace trocar::secure
