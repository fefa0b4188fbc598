#pragma once

// Tets that are changed one node or one edge at a time, each change only if every tet at it keeps a
// shape within given bounds.
//
// Splitting an edge splits all tets at it in two, so that faces match after each change, whatever
// the order. Angles along an edge that was there before never grow by a split: a bound that holds
// after each change holds at the end.
//
// Invariants: every tet has positive volume; tets_of(n) lists the tets of a node. Complexity: a
// change takes time in proportion to the tets at it. Deterministic.

#include <cstdint>
#include <span>
#include <vector>

#include "common/math/vec3.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::mesh {

// Bounds of the dihedral angles of a tet, as cosines: of the smallest angle and of the largest one.
struct ShapeBound {
  double smallest_angle_cosine = 1, largest_angle_cosine = -1;

  static ShapeBound of_degrees(double min_deg, double max_deg);
};

class TetStars {
 public:
  // The tets must have positive volume.
  TetStars(std::vector<Vec3d> positions, std::vector<Tet> tets);

  std::size_t node_count() const { return positions_.size(); }
  const std::vector<Tet>& tets() const { return tets_; }
  const Vec3d& position(NodeIndex node) const { return positions_[node.value]; }
  std::span<const std::uint32_t> tets_of(NodeIndex node) const { return stars_[node.value]; }
  bool is_on_surface(NodeIndex node) const { return is_on_surface_[node.value] != 0; }
  bool is_surface_edge(NodeIndex a, NodeIndex b) const;
  // Nodes that share a tet with it, ascending.
  std::vector<NodeIndex> neighbours(NodeIndex node) const;

  // Whether all tets at the node have a shape within the bound when it is at `to`, m.
  bool can_move(NodeIndex node, const Vec3d& to, const ShapeBound& bound) const;
  void move(NodeIndex node, const Vec3d& to) { positions_[node.value] = to; }

  // Whether all tets at the edge are within the bound when it is split at `at`, m.
  bool can_split(NodeIndex a, NodeIndex b, const Vec3d& at, const ShapeBound& bound) const;
  // Returns the new node, whose number is the highest. a and b must share a tet.
  NodeIndex split(NodeIndex a, NodeIndex b, const Vec3d& at);

  std::vector<Vec3d> take_positions() { return std::move(positions_); }
  std::vector<Tet> take_tets() { return std::move(tets_); }

 private:
  std::vector<std::uint32_t> tets_at(NodeIndex a, NodeIndex b) const;
  bool is_within(const Tet& tet, NodeIndex moved, const Vec3d& to, const ShapeBound& bound) const;

  std::vector<Vec3d> positions_;                   // m
  std::vector<Tet> tets_;                          // positive volume
  std::vector<std::vector<std::uint32_t>> stars_;  // tets of each node
  std::vector<std::uint8_t> is_on_surface_;
};

}  // namespace trocar::mesh
