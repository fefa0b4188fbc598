#pragma once

// What strain is averaged over, against the locking of linear tets (node-based smoothing after
// Dohrmann 2000 and Liu 2008). A node's star are the tets at it of one material whose strain is
// averaged, that with the largest volume there; each gives it a quarter of its volume. A star of
// stress-free volume V has the deformation gradient
//   F = I + 1/V sum over its nodes j of (u_j - u) b_j^T,   b_j = sum over its tets of V_t/4 grad_j,
// which changes by b_i in one direction when node i moves. Energies over stars: averaged_strain.h.
//
// What share of a tet's energy is taken from stars, and what is left to the tet (hyperelastic.h),
// follows from how many of its corners have stars of its material: all four inside a region, fewer
// where regions meet.
//
// Gradients are kept while nodes move, and made anew at each step. Nodes need colours by
// Coupling::Stars: then groups of one colour may be moved at once. Work per move of a node: its
// neighbours, some fifteen.

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "server/tissue/dynamics/groups.h"
#include "server/tissue/dynamics/hyperelastic_parameters.h"

namespace trocar::dynamics {

class Stars {
 public:
  // Of the bracket Psi - 2 C10 (J - 1), the part that is averaged; of the volumetric term all is.
  // With none tissue is too stiff, with all of it too soft, and nodes that move against each other
  // by turns meet no resistance. Found on bars, Cook's membrane and pressed livers of 250 to 4,400
  // nodes (docs/validation.md).
  static constexpr double kAveragedBracket = 0.55;

  // A star that a node is in: its place among gradients(), and the node's b there, m^2.
  struct Row {
    SlotLanes star;
    Vec3Lanes part;

    void pad(std::size_t lane, Slot own) { star.v[lane] = 3 * own; }
  };
  // A node of a star, and its b there, m^2.
  struct Member {
    SlotLanes node;
    Vec3Lanes part;

    void pad(std::size_t lane, Slot own) { node.v[lane] = own; }
  };
  // Rows of V (F - I), m^3; beside them 1/V (1/m^3), 2 C10 kAveragedBracket (Pa), K (Pa). All zero
  // where there is no star.
  using Star = std::array<Float4, 3>;
  // What is left to a tet: of its bracket, and of its volumetric term.
  struct Left {
    double bracket = 1, volumetric = 1;
  };

  static bool are_needed(const organ::Organ& organ);
  // Groups may change later.
  Stars(const Topology& topology, const Groups& groups);

  // The topology has changed: first the nodes whose existence, place or elements have, then, as
  // energies are rebuilt, lanes with a neighbour of one of these, too. Their stars are at rest
  // until they are restarted.
  void follow(const Topology& topology, std::span<const NodeIndex> changed);
  std::size_t rebuild(const Topology& topology, const Groups& groups,
                      std::span<const GroupLanes> lanes);

  // As organ::material_at() counts; kNone: the node has no star.
  static constexpr std::uint16_t kNone = 0xffff;
  std::uint16_t material_of(NodeIndex node) const { return materials_[node.value]; }
  Left left_to(const Topology& topology, TetIndex tet) const;

  // At these displacements (per slot): of a group's nodes.
  void restart_group(Group group, const Float4* x);
  // Nodes of a group, in these lanes, have moved by dx.
  void after_move(Group group, const Vec8& dx, std::uint8_t lanes);

  std::span<const Row> rows(Group group) const { return rows_[group]; }
  std::span<const Member> members(Group group) const { return members_[group]; }
  const Star& at_rest(Slot slot) const { return at_rest_[slot]; }
  std::size_t slot_count() const { return at_rest_.size(); }
  // Three per slot, those of a Star.
  const Float4* gradients() const { return stars_.data(); }
  struct Gradient {
    std::array<Vec8, 3> rows;  // of F
    Float8 inverse_volume, two_c10, bulk;
  };
  [[gnu::always_inline]] inline Gradient gradient_at(const SlotLanes& places) const;

 private:
  // While rows are filled: a node's part in a star, and the other's in the node's own.
  struct Pair {
    NodeIndex other;
    Vec3d part, others_part;
  };

  bool has(const Topology& topology, NodeIndex star, TetIndex tet) const {
    return material_of(star) == topology.material_of(tet);
  }
  void find_material(const Topology& topology, NodeIndex node);
  Star star_at_rest(const Topology& topology, NodeIndex node) const;
  void find_pairs(const Topology& topology, NodeIndex node, std::vector<Pair>& out) const;
  void extend(const Groups& groups);
  std::size_t fill(const Topology& topology, const Groups& groups, GroupLanes lanes);

  const HyperelasticParameters parameters_;  // of materials whose strain is averaged
  std::vector<std::uint16_t> materials_;     // per place of a node
  GroupRows<Row> rows_;
  GroupRows<Member> members_;                    // as many
  std::vector<Star> at_rest_;                    // per slot: at zero displacement
  std::vector<Float4> stars_;                    // three per slot
  std::array<std::vector<Pair>, kLanes> pairs_;  // while rows are filled
};

inline Stars::Gradient Stars::gradient_at(const SlotLanes& places) const {
  Gradient f;
  f.rows[0] = gather(stars_.data(), places, f.inverse_volume);
  f.rows[1] = gather(stars_.data() + 1, places, f.two_c10);
  f.rows[2] = gather(stars_.data() + 2, places, f.bulk);
  for (auto& row : f.rows) row = row * f.inverse_volume;
  f.rows[0].x = f.rows[0].x + all(1);
  f.rows[1].y = f.rows[1].y + all(1);
  f.rows[2].z = f.rows[2].z + all(1);
  return f;
}

}  // namespace trocar::dynamics
