#pragma once

// The surface of a topology as triangles with lasting numbers (SurfaceEdit), kept up to date from
// one edit to the next in proportion to what meets at the changed nodes.

#include <array>
#include <vector>

#include "common/base/blocks.h"
#include "server/tissue/topology/edit.h"

namespace trocar::topology {

class SurfaceMesh {
 public:
  explicit SurfaceMesh(const organ::Organ& organ);

  // Numbers given so far, and the nodes of one; invalid if it is gone.
  std::size_t triangle_count() const { return triangles_.size(); }
  const mesh::Triangle& operator[](TriangleIndex triangle) const {
    return triangles_[triangle.value];
  }
  // Ascending.
  std::span<const TriangleIndex> triangles_of(NodeIndex node) const {
    return triangles_of_[node.value];
  }

  // Follows topology.changed(). Valid until the next call.
  const SurfaceEdit& update(const Topology& topology);

 private:
  struct Face {
    std::array<NodeIndex, 3> key;  // ascending
    mesh::Triangle nodes;          // outward
    bool is_wound = false;
    std::uint16_t material = 0;
  };

  // Returns the area at a node at rest, m^2: a third of each triangle there.
  double area_of(const Topology& topology, NodeIndex node) const;
  void gather_faces(const Topology& topology);
  void remove(TriangleIndex triangle);
  void add(const Face& face);

  std::vector<mesh::Triangle> triangles_;
  Blocks<TriangleIndex> triangles_of_;  // per node
  SurfaceEdit edit_;
  // Scratch.
  std::vector<std::uint8_t> is_changed_;  // per node
  std::vector<Face> faces_;
  std::vector<std::pair<std::array<NodeIndex, 3>, TriangleIndex>> old_;
  std::vector<TriangleIndex> gone_;
};

}  // namespace trocar::topology
