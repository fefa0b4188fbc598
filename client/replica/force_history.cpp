#include "client/replica/force_history.h"

namespace trocar::replica {

ForceHistory::Forces forces_of(std::span<const Tool> tools) {
  ForceHistory::Forces forces{};
  for (const Tool& tool : tools)
    if (const auto owner = tool.slot.owner(); owner.has_tools())
      forces[owner.value] += length(tool.force_n);
  return forces;
}

void ForceHistory::update(const Replica& replica) {
  if (replica.history_version() != history_version_) {
    history_version_ = replica.history_version();
    rings_.clear();
    last_tick_.reset();
  }
  for (const SessionFrame& frame : replica.history()) {
    if (!frame.has_state || (last_tick_ && frame.tick <= *last_tick_)) continue;
    add(frame.tick, forces_of(frame.tools));
    last_tick_ = frame.tick;
  }
}

std::array<float, kForceBins> ForceHistory::forces(ParticipantSlot slot) const {
  return slot.has_tools() ? rings_.oldest_first(slot.value) : std::array<float, kForceBins>{};
}

}  // namespace trocar::replica
