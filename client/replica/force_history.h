#pragma once

// Each hand's force over the last ten seconds of simulated time, for a small plot: per participant
// kForceBins bins, 64 ticks (4 frames) wide, each with the greatest force (N) that fell into it.
//
//   bin of a tick = tick / 64        oldest ... newest
//
// The replica keeps a few frames, and a slow picture misses some: a bin of which no frame told is
// as the one before it, for a second. A new history of the replica (a seek) clears it. Thread:
// render thread.

#include <array>
#include <optional>
#include <span>

#include "client/replica/peak_rings.h"
#include "client/replica/replica.h"

namespace trocar::replica {

inline constexpr Tick kForceBinTicks = 64;
inline constexpr std::size_t kForceBins = 157;  // 10.05 s
inline constexpr Tick kForceGapBins = 16;       // 1 s

class ForceHistory {
 public:
  using Forces = std::array<float, kMaxHands>;  // N, per participant slot

  // Takes in frames of `replica` that it has not seen.
  void update(const Replica& replica);
  // Ticks in any order that does not go back by more than a bin; earlier ones are ignored.
  void add(Tick tick, const Forces& forces_n) { rings_.add(tick / kForceBinTicks, forces_n); }

  // Returns the bins of one hand, oldest first, the bin that is being filled last. Valid until the
  // next add().
  std::array<float, kForceBins> forces(ParticipantSlot slot) const;
  // The greatest of all hands in the window.
  float greatest() const { return rings_.greatest(); }

 private:
  PeakRings<kMaxHands, kForceBins, kForceGapBins> rings_;
  std::uint64_t history_version_ = 0;
  std::optional<Tick> last_tick_;  // of the last frame taken in
};

// Returns what each participant's tools feel together, as sums of magnitudes.
ForceHistory::Forces forces_of(std::span<const Tool> tools);

}  // namespace trocar::replica
