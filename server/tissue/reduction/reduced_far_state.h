#pragma once

// A reduced far field keeps this from tick to tick besides the world's nodes.

#include <cstdint>
#include <vector>

#include "server/tissue/reduction/patch_model.h"
#include "server/tissue/world/state_archive.h"

namespace trocar::reduction {

// Ticks in which all far nodes are put where the fields have them, an equal part in each.
inline constexpr std::uint32_t kPlacingTurns = 8;

void visit(world::StateArchive& archive, PatchSet& set);

struct ReducedFarState {
  bool acts() const { return patches.count > 0; }
  // From now on no patch acts; keeps its memory.
  void end();
  void visit_state(world::StateArchive& archive);

  PatchSet patches;       // whose fields move the organ; none: another solver does
  std::uint32_t age = 0;  // steps since it took over
  float estimate = 0;     // of the error, see ReducedFarField
  double fade = 0;        // of the correction, 1 when it took over
  // Per field.
  std::vector<double> amplitudes, rates;  // of fields of like stiffness (PatchModel), and per s
  std::vector<double> correction;         // what its forces lack beside the organ's at the start
  std::vector<double> relaxed, relaxed_next;  // forces of stress that has relaxed along fields
  std::vector<double> placed;  // amplitudes when nodes were placed last; kPlacingTurns x fields
  std::vector<std::uint8_t> steps_since_placed;  // kPlacingTurns
};

}  // namespace trocar::reduction
