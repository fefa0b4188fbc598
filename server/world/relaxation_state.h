#pragma once

// What tissue remembers of stresses that it has had (quasi-linear viscoelasticity, Dogan 2011 eq. 1
// to 4): per tet the stress that would be there at once, as of the last step, and how much of it
// each relaxation term has taken away since. Symmetric tensors over the pose without stress (second
// Piola-Kirchhoff, Pa), so that the parts of a tet that is split have those of the whole.
//
// Empty for organs of which nothing relaxes. Tets by eights: values of a block lie as
// [tensor][component][tet], with components xx, xy, xz, yy, yz, zz.

#include <span>
#include <vector>

#include "common/base/index.h"
#include "common/scene/organ.h"
#include "server/world/state_archive.h"

namespace trocar::world {

class RelaxationState {
 public:
  static constexpr std::size_t kTets = 8, kComponents = 6;

  explicit RelaxationState(const scene::Organ& organ);

  bool is_empty() const { return tensors_ == 0; }
  // Of any material.
  std::size_t terms() const { return tensors_ - 1; }
  std::size_t block_size() const { return tensors_ * kComponents * kTets; }
  std::size_t block_count() const { return is_empty() ? 0 : values_.size() / block_size(); }
  std::span<float> block(std::size_t index) {
    return std::span(values_).subspan(index * block_size(), block_size());
  }
  std::span<const float> block(std::size_t index) const {
    return std::span(values_).subspan(index * block_size(), block_size());
  }

  // The child is a part of what was the parent; it may be a new tet.
  void inherit(TetIndex child, TetIndex parent);

  void visit_state(StateArchive& archive);

 private:
  void extend(std::size_t tets);
  std::size_t place(TetIndex tet) const {
    return tet.value / kTets * block_size() + tet.value % kTets;
  }

  std::size_t tensors_ = 0;  // per tet
  std::vector<float> values_;
};

}  // namespace trocar::world
