#pragma once

// A request to start a session: a small object of JSON, strict.

#include <string>
#include <string_view>

#include "common/base/result.h"

namespace trocar::hall {

inline constexpr std::size_t kMostRequestBytes = 4096;

struct StartRequest {
  std::string offer;  // {"start": "find-the-lump"}
  std::string name;   // {"name": "group-a"}; empty: the hall gives one
};

// Anything else is ErrorCode::BadMessage with one line.
Result<StartRequest> parse_start_request(std::string_view text);

}  // namespace trocar::hall
