#pragma once

// Tick, recording and clients say with these what became of a tool's claim on tissue. The numbers
// are those of proto::ClaimOutcome.

#include <cstdint>

namespace trocar::wire {

enum class ClaimOutcome : std::uint8_t {
  Granted = 0,
  RefusedHeld = 1,
  RefusedNothingInReach = 2,
  Released = 3,
  TakenOver = 4,
  Expired = 5,
  Slipped = 6,  // the tissue was pulled out of the grasp
};
inline constexpr int kClaimOutcomes = 7;

inline bool is_refusal(ClaimOutcome outcome) {
  return outcome == ClaimOutcome::RefusedHeld || outcome == ClaimOutcome::RefusedNothingInReach;
}

}  // namespace trocar::wire
