#pragma once

// Looks for sessions that announce themselves on the local network. What it finds was said by
// others.

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/discovery/notice.h"

namespace trocar::discovery {

inline constexpr std::size_t kMostSessions = 256;

struct FoundSession {
  SessionNotice notice;
  std::string address;  // IPv4
  std::uint16_t port = 0;
};

// Looks for that long; by name, each once. An error if no Avahi daemon runs here.
Result<std::vector<FoundSession>> find_sessions(double seconds);

// A table for people, or a line that says that there is none.
std::string to_table(const std::vector<FoundSession>& sessions);

}  // namespace trocar::discovery
