#include "server/tissue/reduction/reduced_far_state.h"

#include <cmath>

#include "server/organs/organ/local_reduction.h"

namespace trocar::reduction {
namespace {

constexpr std::uint32_t kMaxFields = PatchSet::kMaxPatches * organ::kMaxLocalFields;

}  // namespace

void visit(world::StateArchive& archive, PatchSet& set) {
  archive.value(set.count);
  if (archive.is_reading() && set.count > PatchSet::kMaxPatches) {
    archive.fail();
    set = {};
  }
  for (std::uint32_t i = 0; i < set.count; ++i) archive.value(set.patches[i]);
  for (std::uint32_t i = 0; i + 1 < set.count; ++i)
    if (set.patches[i] >= set.patches[i + 1]) archive.fail();
}

void ReducedFarState::end() {
  patches = {};
  age = 0;
  estimate = 0;
  fade = 0;
  for (auto* values : {&amplitudes, &rates, &correction, &relaxed, &relaxed_next, &placed})
    values->clear();
  steps_since_placed.clear();
}

void ReducedFarState::visit_state(world::StateArchive& archive) {
  visit(archive, patches);
  if (!acts()) {
    if (archive.is_reading()) end();
    return;
  }
  archive.value(age);
  archive.value(estimate);
  archive.value(fade);
  for (auto* values : {&amplitudes, &rates, &correction, &relaxed, &relaxed_next}) {
    archive.sized_array(*values, kMaxFields);
    if (values->size() != amplitudes.size()) archive.fail();
  }
  archive.sized_array(placed, kPlacingTurns * kMaxFields);
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

}  // namespace trocar::reduction
