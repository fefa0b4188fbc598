#pragma once

#include <cstddef>
#include <string>

#include "common/base/result.h"

namespace trocar::dogan {

// Usage error that names the option unless low <= value <= high.
inline Status check_count(const char* option, std::size_t value, std::size_t low,
                          std::size_t high) {
  if (value >= low && value <= high) return {};
  return Error{ErrorCode::Usage, std::string(option) + ": " + std::to_string(value) +
                                     " is not from " + std::to_string(low) + " to " +
                                     std::to_string(high)};
}

}  // namespace trocar::dogan
