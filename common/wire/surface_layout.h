#pragma once

// The layout says which nodes of an organ its surface stream carries, and in which slots. The
// server builds it from the organ (server/tissue/world/surface_layout.h); clients receive it as a
// SurfaceTopology message. Cuts change it by SurfaceChange (surface_change.h) only.

#include <array>
#include <span>
#include <vector>

#include "common/base/index.h"
#include "common/wire/quantise.h"
#include "common/wire/surface_change.h"

namespace trocar::wire {

struct SurfaceLayout {
  std::uint32_t epoch = 0;
  // Per slot: at first in Morton order of the rest positions, then in the order of appearance.
  // Invalid where only the server knows nodes.
  std::vector<NodeIndex> node_of_vertex;
  std::vector<VertexIndex> vertex_of_node;   // per node; invalid for interior nodes
  std::vector<Corners> triangles;            // by number; three invalid corners: removed
  std::vector<std::uint8_t> is_wound;        // per triangle: made by a blade
  std::vector<QuantisedVertex> rest_quanta;  // per slot
  std::vector<VertexIndex> fixed_vertices;   // ascending slots
  std::uint64_t triangle_sum = 0;            // see SurfaceChange::sum

  std::size_t vertex_count() const { return rest_quanta.size(); }
  Vec3d rest_m(VertexIndex vertex) const {  // world frame
    return to_double(to_metres(rest_quanta[vertex.value]));
  }
  bool has_triangle(TriangleIndex number) const { return triangles[number.value][0].is_valid(); }
  // Computes the sum from the first triangle on.
  std::uint64_t compute_triangle_sum() const;

  bool operator==(const SurfaceLayout&) const = default;
};

// The surface of a mesh at rest. rest_m: positions of all nodes; triangles: corners are surface
// nodes, counterclockwise from outside.
SurfaceLayout make_surface_layout(std::span<const Vec3d> rest_m,
                                  std::span<const NodeIndex> surface_nodes,
                                  std::span<const std::array<NodeIndex, 3>> triangles,
                                  std::span<const NodeIndex> fixed_nodes);

}  // namespace trocar::wire
