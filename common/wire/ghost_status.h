#pragma once

// The status says how the full solution fares that is computed beside a session with a reduction.
// The numbers are those of proto::GhostStatus.

#include <cstdint>

namespace trocar::wire {

enum class GhostStatus : std::uint8_t {
  Unknown = 0,  // nothing heard yet, or a number that this program does not know
  None = 1,     // the session has no reduction
  Begins = 2,   // it waits for a state of the session to begin from
  Follows = 3,  // it has the frame
  Changed = 4,  // the surface has changed: it begins again
  Behind = 5,   // it did not keep up: it begins again
};
inline constexpr int kGhostStatuses = 6;

}  // namespace trocar::wire
