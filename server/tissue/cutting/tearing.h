#pragma once

// Tissue tears at a node around which it is stretched beyond what its material stands
// (Material::tear_stretch), across the direction in which it is stretched most.
//
// The stretch at a node is that of the mean of F^T F over its tets by their volume at rest, F the
// gradient of deformation from the rest pose; its largest principal value is the square of the
// largest stretch, the direction is in the rest pose. The node's tets on both sides of the plane
// across that direction part (as O'Brien and Hodgins 1999 part a node, along faces as they are).
// What parts is opened as cuts are, as far as the surface stays manifold (opening.h). A tear that
// would leave a piece of fewer than kLeastTorn tets is left out: so whatever is torn, and however,
// there is at most one piece more per kLeastTorn tets.

#include <span>
#include <vector>

#include "server/tissue/cutting/faces.h"

namespace trocar::cutting {

// Nodes that tear in one call; others follow in later ones.
inline constexpr std::size_t kMostTears = 8;
// Tets of a piece that tears off.
inline constexpr std::size_t kLeastTorn = 16;

class Tearing {
 public:
  explicit Tearing(const organ::Organ& organ);

  // Whether any material tears.
  bool is_possible() const { return least_stretch_ > 0; }

  // Faces that part at these nodes, the most stretched first; valid until the next call.
  // displacements: of all nodes, m. O(edges at the nodes), their tets where edges have changed by a
  // good part of what tears, and kLeastTorn tets on both sides of each face.
  std::span<const TetFace> find(const topology::Topology& topology,
                                std::span<const Vec3f> displacements,
                                std::span<const NodeIndex> nodes);

 private:
  struct Tear {
    double excess = 0;  // stretch over what the material stands
    NodeIndex node;
    Vec3d across;
  };

  bool is_near_rest(const topology::Topology& topology, std::span<const Vec3f> displacements,
                    NodeIndex node) const;
  void part(const topology::Topology& topology, const Tear& tear);
  // Whether the faces would set a piece free, or be in one, that is too small to tear.
  bool leaves_debris(const topology::Topology& topology, std::span<const TetFace> faces);
  bool is_debris(const topology::Topology& topology, TetIndex tet);

  double least_stretch_ = 0;
  std::vector<Tear> tears_;
  std::vector<TetFace> faces_, parted_;  // parted_: sorted
  std::vector<TetIndex> piece_;          // as far as it has been seen
};

}  // namespace trocar::cutting
