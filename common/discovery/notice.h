#pragma once

// Sessions announce themselves on the local network by DNS-SD (RFC 6763), as _trocar._tcp. A notice
// says what a person chooses by. It travels as TXT records, which anybody may send: whatever comes
// in is bounded and made printable.

#include <span>
#include <string>
#include <vector>

namespace trocar::discovery {

inline constexpr const char* kServiceType = "_trocar._tcp";
inline constexpr std::size_t kMostNameBytes = 63;  // of an instance, RFC 6763 4.1.1
inline constexpr std::size_t kMostValueBytes = 64;
inline constexpr int kMostPeople = 999;

struct SessionNotice {
  std::string name;  // of the session, as the DNS-SD instance
  std::string organ;
  int people = 0;
  bool needs_code = true;
  std::string protocol;  // "1.9"

  bool operator==(const SessionNotice&) const = default;
};

// Cuts a text to what a notice may hold, between characters, with question marks for what cannot be
// printed.
std::string bounded_text(std::string_view text, std::size_t limit);

// The records "key=value" of a notice. The name is not among them.
std::vector<std::string> to_txt(const SessionNotice& notice);
// Unknown records are passed over, missing ones leave what is above; of equal keys the first
// counts.
SessionNotice from_txt(const std::string& name, std::span<const std::string> records);

}  // namespace trocar::discovery
