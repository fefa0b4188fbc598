#pragma once

// Each hand's force over the last ten seconds of simulated time, for a small plot: per participant
// a ring of kForceBins bins, 64 ticks (4 frames) wide, each with the greatest force (N) that fell
// into it, so that a short peak is not lost between two samples.
//
//   bin of a tick = tick / 64        oldest ... newest
//
// A bin of which no frame told (the replica keeps a few, and a slow picture misses some) is as the
// one before it, for a second; after that 0. Bounded whatever comes: 16 rings of fixed size. A new
// history of the replica (a seek) clears it. Thread: render thread.

#include <array>
#include <span>

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
  void clear();
  // Ticks in any order that does not go back by more than a bin; earlier ones are ignored.
  void add(Tick tick, const Forces& forces_n);

  // Returns the bins of one hand, oldest first, the bin that is being filled last. Valid until the
  // next add().
  std::array<float, kForceBins> forces(ParticipantSlot slot) const;
  // The greatest of all hands in the window.
  float greatest() const;

 private:
  std::array<std::array<float, kForceBins>, kMaxHands> rings_{};
  Tick newest_bin_ = 0;
  bool is_empty_ = true;
  std::uint64_t history_version_ = 0;
  Tick last_tick_ = 0;  // of the last frame taken in
};

// Returns what each participant's tools feel together, as sums of magnitudes.
ForceHistory::Forces forces_of(std::span<const Tool> tools);

}  // namespace trocar::replica
