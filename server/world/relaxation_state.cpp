#include "server/world/relaxation_state.h"

#include <algorithm>
#include <cmath>

#include "common/scene/any_material.h"

namespace trocar::world {

RelaxationState::RelaxationState(const scene::Organ& organ) {
  std::size_t most = 0;
  scene::any_material(organ, [&](const scene::Material& m) {
    if (m.elastic_law == scene::ElasticLaw::Measured)
      most = std::max(most, m.measured.relaxation.size());
    return false;
  });
  if (most == 0) return;
  tensors_ = most + 1;
  extend(organ.mesh.tets.size());
}

void RelaxationState::extend(std::size_t tets) {
  const auto size = (tets + kTets - 1) / kTets * block_size();
  if (size > values_.size()) values_.resize(size);
}

void RelaxationState::inherit(TetIndex child, TetIndex parent) {
  if (is_empty()) return;
  extend(child.value + std::size_t{1});
  for (std::size_t i = 0; i < tensors_ * kComponents; ++i)
    values_[place(child) + i * kTets] = values_[place(parent) + i * kTets];
}

void RelaxationState::visit_state(StateArchive& archive) {
  archive.fixed_array(values_);
  if (archive.is_reading() &&
      !std::ranges::all_of(values_, [](float v) { return std::isfinite(v); }))
    archive.fail();
}

}  // namespace trocar::world
