#pragma once

// Which nodes of an organ its surface stream carries, and in which slots. Server, journal and tests
// build it from the organ; clients receive it as a SurfaceTopology message.

#include <array>
#include <vector>

#include "common/base/index.h"
#include "common/scene/organ.h"
#include "common/wire/quantise.h"

namespace trocar::wire {

struct SurfaceLayout {
  std::vector<NodeIndex> node_of_vertex;              // per slot, Morton order of rest positions
  std::vector<VertexIndex> vertex_of_node;            // per node; invalid for interior nodes
  std::vector<std::array<VertexIndex, 3>> triangles;  // outward, in the organ's triangle order
  std::vector<QuantisedVertex> rest_quanta;           // per slot
  std::vector<VertexIndex> fixed_vertices;            // ascending slots

  std::size_t vertex_count() const { return node_of_vertex.size(); }
};

SurfaceLayout make_surface_layout(const scene::Organ& organ);

}  // namespace trocar::wire
