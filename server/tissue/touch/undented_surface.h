#pragma once

// The surface around a tool as it would be without the tool: as it was when the tool began to
// touch, carried along by what others have moved since around the dent. A hand's depth is measured
// from it. The dented surface would not do: it is where the tool is.
//
// The tissue around a dent sinks with it, for seconds, as relaxed tissue far away gives way. That
// is a part of what the hand feels, and no motion of the surface's own. So it follows while others
// act on the organ, and else stays. While they do, how much the surroundings sink with the dent is
// taken off: by the depth, whatever has relaxed, for force would not tell.

#include <array>
#include <optional>
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
  // The tool has cut what was taken: takes what there is now, without the faces of the wound. They
  // do not face as the surface does that the blade has come through.
  void take_beside_wound(const world::World& world, const wire::SurfaceLayout& layout,
                         const Vec3f& place);
  // Once a frame while the tool is near and does not touch: what was taken follows the surface
  // slowly. A dent that a tool has left fills up meanwhile, and is none of the surface's own shape.
  void settle(const world::World& world, const wire::SurfaceLayout& layout, const Vec3f& place);
  void clear();
  bool is_known() const { return !triangles_.empty(); }
  // Whether a triangle near `place` is gone: the surface there is another one.
  bool has_changed(const wire::SurfaceLayout& layout, const Vec3f& place) const;

  // Once a frame while the tool touches: follows what others have moved, and takes more of the
  // surface where the tool has slid.
  // core: in the tool's middle, where it touches; so far from its skin is radius_m.
  void follow(const world::World& world, const wire::SurfaceLayout& layout, const Vec3f& core,
              float radius_m, bool do_others_act);

  // How thick the tissue is below a point of it, and how much its outer face is curved there (the
  // mean of both directions, 1/m, positive outward). Nothing: no other face is near.
  struct Wall {
    float thickness_m, curvature;
  };
  std::optional<Wall> wall(const Plane& plane) const;

  // The point of it that is nearest to `place` on the side from which the tool came, with the
  // normal averaged over `radius_m` around. Known. Deep under a sharp edge another face is nearer
  // at once, and none is from above: so what is nearest is sought from the plane of the frame
  // before.
  Plane plane(const Vec3f& place, float radius_m) const;
  // The same, and the next frame begins with its face.
  Plane felt_plane(const Vec3f& place, float radius_m);

 private:
  struct Triangle {
    TriangleIndex number;
    std::array<NodeIndex, 3> nodes;
    std::array<Vec3f, 3> at;  // as they were taken
    Vec3f centre, normal;     // as it was taken; the normal times twice the area
    float reach_m = 0;        // of its corners from the centre
  };

  static void shape(Triangle& triangle);
  static Vec3f nearest_on(const Triangle& triangle, const Vec3f& at);
  struct Nearest {
    const Triangle* triangle = nullptr;  // null: there is none
    Vec3f point, away;                   // away: from it to the place
    Vec3f facing;  // sum of the unit normals of the triangles that are as near
  };
  Nearest nearest(const Vec3f& place) const;
  Plane plane_of(const Nearest& nearest, float radius_m) const;
  // The other face of a thin wall is none that the tool could come out of.
  bool is_outside(const Triangle& triangle) const { return dot(triangle.normal, outward_) >= 0; }
  // motion: of the surface at places that are new.
  void take(const world::World& world, const wire::SurfaceLayout& layout, const Vec3f& centre,
            const Vec3f& motion);
  Vec3f ring_motion(const world::World& world, const Vec3f& place) const;

  std::vector<Triangle> triangles_, kept_;  // ascending numbers
  Vec3f centre_;                            // around which it was taken
  Vec3f moved_;                             // since it was taken, by others
  Vec3f kept_off_;                          // what the ring has moved besides
  Vec3f outward_;                           // under the tool; 0: it does not touch yet
  Vec3f face_point_, face_normal_;          // pressed in the last frame, less moved_; 0: none
  float least_facing_ = -1;                 // only what faces outward_ by this cosine is taken
  // Means that forget, of the ring's motion along the normal over how far a half space would sink.
  float sinks_ = 0, motion_ = 0, variance_ = 0, covariance_ = 0;
};

}  // namespace trocar::touch
