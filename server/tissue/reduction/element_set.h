#pragma once

// Some tets of an organ at work in a reduced model, eight at once: forces and tangents of the
// hyperelastic laws over local nodes, in single precision. What is small at small strain is
// computed from displacement gradients, so that no digits are lost there. Every sum has a fixed
// order. Immutable once made.

#include <span>
#include <variant>
#include <vector>

#include "server/organs/organ/organ.h"
#include "server/tissue/dynamics/psi.h"
#include "server/tissue/reduction/block_matrix.h"

namespace trocar::reduction {

// ForcePart selects all of a tet's forces, or what is left without the linear response at rest.
enum class ForcePart : std::uint8_t { Whole, Nonlinear };

class ElementSet {
 public:
  ElementSet() = default;
  // Weights: one per tet, or none if all are 1. Local nodes: ascending, all that the tets have. The
  // organ's laws are unsplit and hyperelastic.
  ElementSet(const organ::Organ& organ, std::span<const TetIndex> tets,
             std::span<const float> weights, std::span<const NodeIndex> local_nodes);

  std::size_t tet_count() const { return tet_count_; }
  // u, f: x, y, z per local node, m and N. Adds what the tets resist with.
  void add_forces(ForcePart part, std::span<const float> u, std::span<float> f) const;
  // Pairs of nodes that share a tet.
  void add_pairs(std::vector<BlockMatrix::Pair>& pairs) const;
  // Adds the tangent at rest, which ForcePart::Nonlinear leaves out.
  void add_rest_tangent(BlockMatrix& tangent) const;
  // Adds the tangent of the whole forces. Without `with_stress` what stress adds to it is left out:
  // then it is positive semidefinite whatever the strain.
  void add_tangent(std::span<const float> u, bool with_stress, BlockMatrix& tangent) const;

 private:
  using Law = std::variant<dynamics::ReducedPolynomialLaw, dynamics::ExponentialLaw>;
  struct Group {
    std::array<dynamics::SlotLanes, 4> nodes;          // local
    std::array<dynamics::Vec3Lanes, 3> gradients;      // of the second to fourth corner, 1/m
    dynamics::Lanes twice_c10_v, bulk_v, curvature_v;  // 2 C10 V, K V, 4 Psi''(0) V; J
    std::uint32_t law = 0;
    std::uint32_t used = 0;  // lanes
  };
  struct Strain;
  static void add_block(const Group& group, std::size_t a, std::size_t b,
                        const dynamics::Mat8& block, BlockMatrix& tangent);
  static Strain strain_of(const Group& group, std::span<const float> u);
  template <typename Psi>
  void add_forces(const Psi& law, const Group& group, ForcePart part, std::span<const float> u,
                  std::span<float> f) const;
  template <typename Psi>
  void add_tangent(const Psi& law, const Group& group, std::span<const float> u, bool with_stress,
                   BlockMatrix& tangent) const;

  std::size_t tet_count_ = 0;
  std::vector<Law> laws_;
  std::vector<Group> groups_;
};

}  // namespace trocar::reduction
