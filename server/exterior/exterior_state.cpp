#include "server/exterior/exterior_state.h"

#include <cmath>

#include "common/scene/local_reduction.h"

namespace trocar::exterior {

void ExteriorState::visit_state(world::StateArchive& archive) {
  archive.value(patch);
  if (!acts()) {
    if (archive.is_reading()) *this = {};
    return;
  }
  archive.value(age);
  archive.value(estimate);
  archive.value(fade);
  for (auto* values : {&amplitudes, &rates, &correction, &relaxed, &relaxed_next}) {
    archive.sized_array(*values, scene::kMaxLocalFields);
    if (values->size() != amplitudes.size()) archive.fail();
  }
  archive.sized_array(placed, kPlacingTurns * scene::kMaxLocalFields);
  archive.sized_array(steps_since_placed, kPlacingTurns);
  if (!archive.is_reading()) return;
  if (placed.size() != kPlacingTurns * amplitudes.size() ||
      steps_since_placed.size() != kPlacingTurns || !std::isfinite(fade) ||
      !std::isfinite(estimate))
    archive.fail();
  for (const auto* values : {&amplitudes, &rates, &correction, &relaxed, &relaxed_next, &placed})
    for (const double value : *values)
      if (!std::isfinite(value)) archive.fail();
}

}  // namespace trocar::exterior
