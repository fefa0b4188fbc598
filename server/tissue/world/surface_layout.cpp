#include "server/tissue/world/surface_layout.h"

namespace trocar::world {

wire::SurfaceLayout make_surface_layout(const organ::Organ& organ) {
  const auto& mesh = organ.mesh;
  return wire::make_surface_layout(mesh.rest_positions, mesh.surface_nodes, mesh.boundary_triangles,
                                   organ.fixed_nodes);
}

}  // namespace trocar::world
