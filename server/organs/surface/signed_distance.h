#pragma once

// Distance to a closed surface, negative inside.
//
// The sign is that of the angle-weighted normal at the nearest point: of the triangle, of the edge
// or of the corner it lies on, which is right for closed surfaces that do not pass through
// themselves.
//
// Source: Baerentzen, Aanaes: Signed distance computation using the angle weighted pseudonormal,
// IEEE TVCG 11(3), 2005.

#include <array>
#include <vector>

#include "server/organs/surface/closed_surface.h"
#include "server/organs/surface/triangle_tree.h"

namespace trocar::surface {

// The surface must outlive it. A const one may be used by any thread.
class SignedDistance {
 public:
  explicit SignedDistance(const ClosedSurface& surface);

  double operator()(const Vec3d& p) const;  // m

 private:
  const ClosedSurface& surface_;
  TriangleTree tree_;
  std::vector<Vec3d> normals_;                      // of triangles, of length 1
  std::vector<std::array<Vec3d, 3>> edge_normals_;  // from each corner to the next; not normalised
  std::vector<Vec3d> corner_normals_;               // of vertices; not normalised
};

}  // namespace trocar::surface
