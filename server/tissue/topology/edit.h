#pragma once

// One edit of a topology as a value: whoever keeps something that depends on nodes, tets or the
// surface is handed it once, and brings that up to date. The spans are valid until the topology's
// clear_changes().
//
// Triangles of the surface have lasting numbers: those of the mesh's boundary triangles, then the
// next ones; the number of a triangle that is gone is never used again.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/tissue/topology/topology.h"

namespace trocar::topology {

// displacement(node) = a + (b - a) t/65536 of the displacements at its parents; velocity likewise.
// A copy has its original as both. A node that is not new but has moved along an edge, which is
// straight now as it was at rest, has itself as a.
struct NewNode {
  NodeIndex node, a, b;
  std::uint16_t t = 0;

  bool has_moved() const { return node == a; }
  bool is_copy() const { return a == b; }
};

struct SurfaceEdit {
  struct Triangle {
    std::array<NodeIndex, 3> nodes;  // counter-clockwise seen from outside
    bool is_wound = false;           // where tissue was inside before a cut
    std::uint16_t material = 0;      // of the tet behind it, as organ::material_at() counts
  };

  std::vector<TriangleIndex> removed;  // ascending
  std::vector<Triangle> added;         // the next numbers, in order
  std::vector<NodeIndex> surfaced;     // nodes that were not on the surface, ascending
  std::vector<NodeIndex> touched;      // nodes of what was removed and added, ascending
  std::vector<float> areas_m2;         // per entry of `touched`: at rest, a third of each triangle

  void clear() {
    removed.clear(), added.clear(), surfaced.clear(), touched.clear(), areas_m2.clear();
  }
};

// Ties go on from their rest places, after an edit of the surface and before it is handed out.
void follow_ties(const SurfaceEdit& surface, Topology& topology);

struct Edit {
  const Topology& topology;            // after the edit; changed() and parts() are the edit's
  std::span<const NewNode> new_nodes;  // in their order, which is that of the places
  const SurfaceEdit& surface;
};

}  // namespace trocar::topology
