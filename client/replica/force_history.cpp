#include "client/replica/force_history.h"

#include <algorithm>

namespace trocar::replica {

ForceHistory::Forces forces_of(std::span<const Tool> tools) {
  ForceHistory::Forces forces{};
  for (const Tool& tool : tools)
    if (const auto owner = tool.slot.owner(); owner.has_tools())
      forces[owner.value] += length(tool.force_n);
  return forces;
}

void ForceHistory::clear() {
  for (auto& ring : rings_) ring.fill(0);
  is_empty_ = true;
  last_tick_ = 0;
}

void ForceHistory::update(const Replica& replica) {
  if (replica.history_version() != history_version_) {
    history_version_ = replica.history_version();
    clear();
  }
  for (const SessionFrame& frame : replica.history()) {
    if (!frame.has_state || (!is_empty_ && frame.tick <= last_tick_)) continue;
    add(frame.tick, forces_of(frame.tools));
    last_tick_ = frame.tick;
  }
}

void ForceHistory::add(Tick tick, const Forces& forces_n) {
  const Tick bin = tick / kForceBinTicks;
  if (is_empty_) newest_bin_ = bin;
  if (bin < newest_bin_) return;
  const Tick passed = bin - newest_bin_;
  for (auto& ring : rings_) {
    const float last = ring[static_cast<std::size_t>(newest_bin_ % kForceBins)];
    // Beyond a whole turn, all bins are passed over.
    for (Tick step = 0; step < std::min<Tick>(passed, kForceBins); ++step)
      ring[static_cast<std::size_t>((bin - step) % kForceBins)] =
          step == 0 || passed - step > kForceGapBins || passed > kForceBins ? 0 : last;
  }
  newest_bin_ = bin;
  is_empty_ = false;
  for (std::size_t hand = 0; hand < rings_.size(); ++hand) {
    float& value = rings_[hand][static_cast<std::size_t>(bin % kForceBins)];
    value = std::max(value, forces_n[hand]);
  }
}

std::array<float, kForceBins> ForceHistory::forces(ParticipantSlot slot) const {
  std::array<float, kForceBins> out{};
  if (is_empty_ || !slot.has_tools()) return out;
  const auto& ring = rings_[slot.value];
  for (std::size_t i = 0; i < kForceBins; ++i)
    out[i] = ring[static_cast<std::size_t>((newest_bin_ + 1 + i) % kForceBins)];
  return out;
}

float ForceHistory::greatest() const {
  float most = 0;
  for (const auto& ring : rings_) most = std::max(most, *std::ranges::max_element(ring));
  return most;
}

}  // namespace trocar::replica
