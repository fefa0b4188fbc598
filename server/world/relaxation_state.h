#pragma once

// What tissue remembers of stresses that it has had (quasi-linear viscoelasticity, Dogan 2011 eq. 1
// to 4): per tet the stress that would be there at once, as of the step that advanced it last, and
// how much of it each relaxation term has taken away since. Symmetric tensors over the pose without
// stress (second Piola-Kirchhoff, Pa), so that the parts of a tet that is split have those of the
// whole. And per node the force of what has relaxed, as of the step that took it last.
//
// Empty for organs of which nothing relaxes. Tets by eights: values of a block lie as
// [tensor][component][tet], with components xx, xy, xz, yy, yz, zz. A solver advances some blocks
// in a step: the tick hash covers a sum of theirs, which follows in O(blocks that changed).

#include <array>
#include <span>
#include <vector>

#include "common/base/index.h"
#include "common/scene/organ.h"
#include "server/world/state_archive.h"

namespace trocar::world {

class RelaxationState {
 public:
  static constexpr std::size_t kTets = 8, kComponents = 6;
  using Steps = std::array<std::uint8_t, kTets>;

  explicit RelaxationState(const scene::Organ& organ);

  // The most that a material of the organ has.
  static std::size_t terms_of(const scene::Organ& organ);

  bool is_empty() const { return tensors_ == 0; }
  std::size_t block_size() const { return tensors_ * kComponents * kTets; }
  std::size_t block_count() const { return is_empty() ? 0 : values_.size() / block_size(); }
  std::span<const float> block(std::size_t index) const {
    return std::span(values_).subspan(index * block_size(), block_size());
  }
  // Steps since each of its tets was advanced.
  Steps age(std::size_t index) const;

  // Counts a step.
  void begin_step() { ++step_; }
  // Of all that there were, modulo 256.
  std::uint8_t step() const { return step_; }

  // A block to be advanced to this step. Once its values are written, advanced() gives what
  // add_to_hash() wants, alone or summed over blocks. Different blocks at once: allowed.
  std::span<float> block(std::size_t index) {
    return std::span(values_).subspan(index * block_size(), block_size());
  }
  std::uint64_t advanced(std::size_t index);
  void add_to_hash(std::uint64_t difference) { hash_ += difference; }

  // N; of as many nodes as the world has.
  std::span<const Vec3f> forces() const { return forces_; }
  void set_force(NodeIndex node, const Vec3f& force) { forces_[node.value] = force; }

  // A new node, on which no force acts yet.
  void add_node() {
    if (!is_empty()) forces_.emplace_back();
  }
  // The child is a part of what was the parent; it may be a new tet.
  void inherit(TetIndex child, TetIndex parent);

  void visit_state(StateArchive& archive);

 private:
  void extend(std::size_t tets);
  std::uint64_t hash_of(std::size_t block) const;
  // Takes the block's hash anew; by how much the sum changes.
  std::uint64_t rehash(std::size_t block);
  std::size_t place(TetIndex tet) const {
    return tet.value / kTets * block_size() + tet.value % kTets;
  }

  std::size_t tensors_ = 0;  // per tet
  std::vector<float> values_;
  std::vector<std::uint8_t> advanced_in_;  // per tet: step()
  std::vector<Vec3f> forces_;
  std::uint8_t step_ = 0;
  std::vector<std::uint64_t> hashes_;  // per block
  std::uint64_t hash_ = 0;             // their sum
};

}  // namespace trocar::world
