#pragma once

// The surface around a tool as it would be without the tool: as it was when the tool began to
// touch, carried along by what has moved since around the dent. A hand's depth is measured from it.
// The dented surface would not do: it is where the tool is.
//
// The tissue around a dent sinks a little with it, which is not motion of its own. How much it
// sinks per force is fitted, and taken off.

#include <array>
#include <vector>

#include "common/base/index.h"
#include "common/wire/surface_layout.h"
#include "server/tissue/world/world.h"

namespace trocar::touch {

class UndentedSurface {
 public:
  struct Plane {
    Vec3f point, normal;  // m; outward, of unit length
    NodeIndex node;       // a corner of the nearest triangle
  };

  // Takes the surface around `centre` as it is now. O(triangles of the surface).
  void take(const world::World& world, const wire::SurfaceLayout& layout, const Vec3f& centre);
  // Once a frame while the tool is near and does not touch: what was taken follows the surface
  // slowly. A dent that a tool has left fills up meanwhile, and is none of the surface's own shape.
  void settle(const world::World& world, const wire::SurfaceLayout& layout, const Vec3f& place);
  void clear();
  bool is_known() const { return !triangles_.empty(); }
  // Whether a triangle near `place` is gone: the surface there is another one.
  bool has_changed(const wire::SurfaceLayout& layout, const Vec3f& place) const;

  // Once a frame while the tool touches, with its force: follows what has moved since it was taken,
  // and takes more of the surface where the tool has slid.
  // sinks_m_n: a guess of how far the tissue around the dent sinks per force.
  void follow(const world::World& world, const wire::SurfaceLayout& layout, const Vec3f& place,
              const Vec3f& force_n, float sinks_m_n);

  // The nearest point of it to `place`, with the normal averaged over `radius_m` around. Known.
  Plane plane(const Vec3f& place, float radius_m) const;

 private:
  struct Triangle {
    TriangleIndex number;
    std::array<NodeIndex, 3> nodes;
    std::array<Vec3f, 3> at;  // as they were taken
    Vec3f centre, normal;     // as it was taken; the normal times twice the area
  };

  static void shape(Triangle& triangle);
  Vec3f ring_motion(const world::World& world, const Vec3f& place) const;

  std::vector<Triangle> triangles_, kept_;  // ascending numbers
  Vec3f centre_;                            // around which it was taken
  Vec3f moved_;                             // since it was taken
  // Means that forget, of the ring's motion along the normal over the normal force.
  float force_ = 0, motion_ = 0, variance_ = 0, covariance_ = 0;
};

}  // namespace trocar::touch
