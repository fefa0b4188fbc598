#pragma once

// The elastic part of a tissue, but for energies of nodal strain, as matrices: what a node's
// gradient becomes when displacements move away from a pose X,
//   gradient_i(x) = g_i + sum over neighbours j of H_ij [(x_j - X_j) - (x_i - X_i)],
// with g_i and H_ij = d gradient_i / d x_j from the energies at X. A uniform motion changes
// nothing, exactly; the error is of second order in how much neighbours have moved apart.
//
// H_ij are stored as half floats (relative error 5e-4) with a power of two per group: these
// matrices are read once per sweep and memory is what that costs. g and the nodes' own blocks are
// floats. renew() costs two to three evaluations of the energies, add() a fraction of one. Groups
// are independent: several workers, each with its own groups and Scratch.

#include <immintrin.h>

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "server/tissue/dynamics/tissue.h"

namespace trocar::dynamics {

class Linearisation {
 public:
  // Each worker has such a buffer, in which it sums matrices.
  struct Scratch {
    std::vector<std::array<Lanes, 9>> rows;
  };

  // The tissue must outlive it.
  explicit Linearisation(const Tissue& tissue);
  ~Linearisation();

  // Neighbours of the group's nodes anew, and matrices as renew() makes them. Between steps.
  void index(Group group, const Float4* pose);
  // After some calls of index().
  void tidy() {
    rows_.tidy();
    targets_.tidy();
  }
  // Neighbours of a lane.
  template <typename Visit>
  void for_each_neighbour(Slot slot, Visit&& visit) const {
    for (const Row& row : rows_[slot / kLanes])
      if (row.neighbour.v[slot % kLanes] != slot) visit(row.neighbour.v[slot % kLanes]);
  }

  // pose: X, displacements per slot.
  void renew(Group group, const Float4* pose, Scratch& scratch);

  // Adds gradient and block at displacements away from the pose the group was taken at; away: x - X
  // per slot, own: of the group. Returns per lane the largest squared |(x_j - X_j) - (x_i - X_i)|.
  // Inlined whatever the compiler thinks: its result would go through memory.
  [[gnu::always_inline]] inline Float8 add(Group group, const Float4* away, const Vec8& own,
                                           NodeStep8& step) const;

  std::size_t group_count() const { return nodes_.size(); }
  // d gradient / d other, zero if they are no neighbours.
  std::array<std::array<float, 3>, 3> stiffness(Slot slot, Slot other) const;

 private:
  struct Row {
    SlotLanes neighbour;
    std::array<std::array<std::uint16_t, kLanes>, 9> k;  // half floats, times the group's scale
  };
  // Each lane of a call to the sink adds to this row; kNoRow: it has none.
  using Targets = std::array<std::uint8_t, kLanes>;
  static constexpr std::uint8_t kNoRow = 0xff;
  struct Node {
    Vec3Lanes gradient;
    SymMat3Lanes block;
    float scale = 0;
  };
  static Float8 halves(const std::array<std::uint16_t, kLanes>& k) {
    return _mm256_cvtph_ps(_mm_loadu_si128(reinterpret_cast<const __m128i*>(k.data())));
  }
  class Indexing;
  class Summing;

  void take(Group group, std::span<const std::array<Lanes, 9>> sums, const NodeStep8& step);

  const Tissue& tissue_;
  std::vector<Node> nodes_;  // per group
  Blocks<Row> rows_;
  Blocks<Targets> targets_;             // per group and call, in order
  std::unique_ptr<Indexing> indexing_;  // scratch
};

inline Float8 Linearisation::add(Group group, const Float4* away, const Vec8& own,
                                 NodeStep8& step) const {
  Vec8 sum = zero_vec8();
  Float8 farthest = all(0);
  for (const Row& row : rows_[group]) {
    const Vec8 d = gather(away, row.neighbour) - own;
    farthest = _mm256_max_ps(farthest, dot8(d, d));
    const auto line = [&](std::size_t i, Float8 start) {
      return fma8(halves(row.k[3 * i + 2]), d.z,
                  fma8(halves(row.k[3 * i + 1]), d.y, fma8(halves(row.k[3 * i]), d.x, start)));
    };
    sum = {line(0, sum.x), line(1, sum.y), line(2, sum.z)};
  }
  const Node& node = nodes_[group];
  step.gradient = fma8(sum, all(node.scale), step.gradient + load(node.gradient));
  const SymMat8 block = load(node.block);
  step.block = {step.block.xx + block.xx, step.block.xy + block.xy, step.block.xz + block.xz,
                step.block.yy + block.yy, step.block.yz + block.yz, step.block.zz + block.zz};
  return farthest;
}

}  // namespace trocar::dynamics
