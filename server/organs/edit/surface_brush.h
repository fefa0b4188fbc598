#pragma once

// A brush on an organ's surface: a ball around a place of it. It takes the surface nodes in the
// ball that are reached from that place along the surface, without leaving the ball, so that the
// far side of a thin wall stays as it is. Any thread once it is made.

#include <cstdint>
#include <vector>

#include "common/math/vec3.h"
#include "server/organs/mesh/csr.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::edit {

// A place on the surface: of a boundary triangle, in the organ's frame, m.
struct SurfacePlace {
  std::uint32_t triangle = 0;  // of mesh.boundary_triangles
  Vec3d position_m;
};

class SurfaceBrush {
 public:
  // The mesh outlives the brush. Linear in its surface.
  explicit SurfaceBrush(const mesh::TetMesh& mesh);

  // Ascending; at least the triangle's corner that is nearest to the place, however small the
  // radius is. No place of the mesh: none.
  std::vector<NodeIndex> nodes_at(const SurfacePlace& place, double radius_m) const;
  // These, and inner nodes no farther than the radius from the line through the place along the
  // triangle's normal, and no deeper below the place than `depth_m`, which is at least 0.
  std::vector<NodeIndex> nodes_below(const SurfacePlace& place, double radius_m,
                                     double depth_m) const;

 private:
  const mesh::TetMesh& mesh_;
  mesh::Csr<NodeIndex, NodeIndex> neighbours_;  // of surface nodes, along edges of the surface
};

}  // namespace trocar::edit
