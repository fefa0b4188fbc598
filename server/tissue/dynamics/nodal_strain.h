#pragma once

// NodalStrain averages strain over smoothing domains, against the locking of linear tets
// (node-based smoothing after Dohrmann 2000 and Liu 2008). A node's smoothing domain consists of
// the tets at it of one material whose strain is averaged, that with the largest volume there; each
// tet gives it a quarter of its volume. A smoothing domain of stress-free volume V has the
// deformation gradient
//   F = I + 1/V sum over its nodes j of (u_j - u) b_j^T,   b_j = sum over its tets of V_t/4 grad_j,
// which changes by b_i in one direction when node i moves. Energies of nodal strain:
// nodal_hyperelastic.h.
//
// What share of a tet's energy is taken from smoothing domains, and what is left to the tet
// (hyperelastic.h), follows from how many of its corners have smoothing domains of its material:
// all four inside a region, fewer where regions meet.
//
// Gradients are kept while nodes move, and made anew at each step. Nodes need colours by
// Coupling::NodalStrain: then groups of one colour may be moved at once. Work per move of a node:
// its neighbours, some fifteen.

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "server/tissue/dynamics/groups.h"
#include "server/tissue/dynamics/hyperelastic_parameters.h"

namespace trocar::dynamics {

class NodalStrain {
 public:
  // This part of the bracket Psi - 2 C10 (J - 1) is averaged; the volumetric term is averaged as a
  // whole. Without averaging tissue is too stiff; with all of the bracket averaged it is too soft,
  // and nodes that move against each other by turns meet no resistance. The value was found on
  // bars, Cook's membrane and pressed livers of 250 to 4,400 nodes (docs/validation.md).
  static constexpr double kAveragedBracket = 0.55;

  // A smoothing domain that a node is in: its place among gradients(), and the node's b there, m^2.
  struct Row {
    SlotLanes domain;
    Vec3Lanes part;

    void pad(std::size_t lane, Slot own) { domain.v[lane] = 3 * own; }
  };
  // A node of a smoothing domain, and its b there, m^2.
  struct Member {
    SlotLanes node;
    Vec3Lanes part;

    void pad(std::size_t lane, Slot own) { node.v[lane] = own; }
  };
  // Rows of V (F - I), m^3; beside them 1/V (1/m^3), 2 C10 kAveragedBracket (Pa), K (Pa). All zero
  // where there is no smoothing domain.
  static constexpr std::size_t kRows = 3;
  using Domain = std::array<Float4, kRows>;
  // These shares of a tet's bracket and of its volumetric term are left to the tet.
  struct Left {
    double bracket = 1, volumetric = 1;
  };

  static bool are_needed(const organ::Organ& organ);
  // Groups may change later.
  NodalStrain(const topology::Topology& topology, const Groups& groups);

  // The topology has changed: first the nodes whose existence, place or elements have, then, as
  // energies are rebuilt, lanes with a neighbour of one of these, too. Their smoothing domains are
  // at rest until they are restarted.
  void update(const topology::Topology& topology, std::span<const NodeIndex> changed);
  std::size_t rebuild(const topology::Topology& topology, const Groups& groups,
                      std::span<const GroupLanes> lanes);

  // Materials are numbered as in organ::material_at(); kNone: the node has no smoothing domain.
  static constexpr std::uint16_t kNone = 0xffff;
  std::uint16_t material_of(NodeIndex node) const { return materials_[node.value]; }
  Left left_to(const topology::Topology& topology, TetIndex tet) const;

  // Lanes of a pack hold other slots.
  void pack(const PackedLanes& pack) { rows_.pack(pack); }

  // At these displacements (per slot): of a group's nodes.
  void restart_group(Group group, const Float4* x);
  // Nodes of a group or pack, in these lanes, have moved by dx.
  void after_move(Group group, const Vec8& dx, std::uint8_t lanes);

  std::span<const Row> rows(Group group) const { return rows_[group]; }
  std::span<const Member> members(Group group) const { return members_[group]; }
  const Domain& at_rest(Slot slot) const { return at_rest_[slot]; }
  std::size_t slot_count() const { return at_rest_.size(); }
  // Returns the gradients as they are now: three entries per slot, laid out as a Domain.
  const Float4* gradients() const { return gradients_.data(); }
  struct Gradient {
    std::array<Vec8, 3> rows;  // of F
    Float8 inverse_volume, two_c10, bulk;
  };
  [[gnu::always_inline]] inline Gradient gradient_at(const SlotLanes& places) const;
  // Restarts a group, and returns the gradients of its nodes.
  [[gnu::always_inline]] inline Gradient restarted(Group group, const Float4* x);

 private:
  // While rows are filled: a node's part in a smoothing domain, and the other's in the node's own.
  struct Pair {
    NodeIndex other;
    Vec3d part, others_part;
  };

  // Makes F of V (F - I).
  [[gnu::always_inline]] static inline void finish(Gradient& f);
  bool has(const topology::Topology& topology, NodeIndex domain, TetIndex tet) const {
    return material_of(domain) == topology.material_of(tet);
  }
  void find_material(const topology::Topology& topology, NodeIndex node);
  Domain domain_at_rest(const topology::Topology& topology, NodeIndex node) const;
  void find_pairs(const topology::Topology& topology, NodeIndex node, std::vector<Pair>& out) const;
  void extend(const Groups& groups);
  std::size_t fill(const topology::Topology& topology, const Groups& groups, GroupLanes lanes);

  const HyperelasticParameters parameters_;  // of materials whose strain is averaged
  std::vector<std::uint16_t> materials_;     // per place of a node
  GroupRows<Row> rows_;
  GroupRows<Member> members_;                    // as many
  std::vector<Domain> at_rest_;                  // per slot: at zero displacement
  std::vector<Float4> gradients_;                // three per slot
  std::array<std::vector<Pair>, kLanes> pairs_;  // while rows are filled
};

inline NodalStrain::Gradient NodalStrain::gradient_at(const SlotLanes& places) const {
  Gradient f;
  f.rows[0] = gather(gradients_.data(), places, f.inverse_volume);
  f.rows[1] = gather(gradients_.data() + 1, places, f.two_c10);
  f.rows[2] = gather(gradients_.data() + 2, places, f.bulk);
  finish(f);
  return f;
}

inline NodalStrain::Gradient NodalStrain::restarted(Group group, const Float4* x) {
  const Vec8 own = load_group(x + group * kLanes);
  std::array<Vec8, kRows> h{zero_vec8(), zero_vec8(), zero_vec8()};
  for (const Member& member : members_[group]) {
    const Vec8 u = gather(x, member.node) - own, b = load(member.part);
    h[0] = fma8(b, u.x, h[0]), h[1] = fma8(b, u.y, h[1]), h[2] = fma8(b, u.z, h[2]);
  }
  const std::size_t first = group * kLanes;
  Gradient f;
  Float8* const beside[kRows] = {&f.inverse_volume, &f.two_c10, &f.bulk};
  for (std::size_t r = 0; r < kRows; ++r) {
    f.rows[r] = load_strided(&at_rest_[first][r], kRows, *beside[r]) + h[r];
    store_strided(&gradients_[kRows * first + r], kRows, f.rows[r], *beside[r]);
  }
  finish(f);
  return f;
}

inline void NodalStrain::finish(Gradient& f) {
  for (auto& row : f.rows) row = row * f.inverse_volume;
  f.rows[0].x = f.rows[0].x + all(1);
  f.rows[1].y = f.rows[1].y + all(1);
  f.rows[2].z = f.rows[2].z + all(1);
}

}  // namespace trocar::dynamics
