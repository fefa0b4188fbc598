#pragma once

// The surface that meets itself (self_surface.h) as it is in one pass: normals where nodes are now,
// closest points, and how a node and a triangle touch there. Made for the pass; it refers to what
// it was made from.

#include <span>
#include <vector>

#include "common/base/stamps.h"
#include "server/tissue/contact/self_surface.h"
#include "server/tissue/world/world.h"

namespace trocar::contact {

// Returns whether the node sleeps, or is held and stands still.
inline bool is_asleep_at(std::uint32_t node, const world::World& world) {
  const auto node_class = world.node_classes[node];
  return node_class == world::NodeClass::Asleep ||
         (node_class == world::NodeClass::Fixed && !(length_squared(world.velocities[node]) > 0));
}

// Normals are computed when somebody asks for them; their memory stays from pass to pass.
struct SelfNormals {
  // One normal per node and sort; one per triangle, as long as twice its area.
  std::vector<Vec3f> normals, ups;
  Stamps has_normal, has_up;

  void resize(const SelfSurface& surface);
  // All that is known is of another pass.
  void begin();
};

class SelfSurfaceNow {
 public:
  using Site = SelfSurface::Site;
  using Sort = SelfSurface::Sort;

  struct ClosestPoint {
    TriangleIndex triangle;
    Vec3f weights;
    Vec3f from;  // m, from the point to the node
    float squared = 0;
  };
  struct Touch {
    Vec3f normal, own;              // from the triangle's side to the node's; the node's
    Vec3f at_rest;                  // m, from the point to the node
    float shift = 0;                // m, the gap from which on it presses
    float gap = 0;                  // m, beyond that
    float aside = 0;                // m, across the normal
    float facing = 0, closing = 0;  // cosine of both normals; m/s
  };

  SelfSurfaceNow(SelfSurface& surface, const world::World& world, SelfNormals& normals)
      : surface_(surface), world_(world), normals_(normals) {}

  const SelfSurface& surface() const { return surface_; }
  const world::World& world() const { return world_; }

  Vec3f position(Site site) const { return world_.position(NodeIndex(site)); }
  // Returns the point of a triangle with these weights of its corners.
  Vec3f position(TriangleIndex triangle, const Vec3f& weights) const {
    const auto& [a, b, c] = surface_[triangle];
    return position(a) * weights.x + position(b) * weights.y + position(c) * weights.z;
  }
  // Returns whether the node is farther than this from where it was at rest.
  bool has_moved(Site site, float by_m) const {
    return length_squared(world_.displacements[site]) > by_m * by_m;
  }
  bool is_asleep(Site site, TriangleIndex triangle) const;
  // Returns the squared speed at which a pair leaves its place, m2/s2.
  float squared_drift(Site site, TriangleIndex triangle, const Vec3f& weights) const;

  const Vec3f& normal(Site site, Sort sort) {
    const std::size_t place = 2 * std::size_t{site} + static_cast<std::size_t>(sort);
    if (!normals_.has_normal.insert(place)) return normals_.normals[place];
    return normals_.normals[place] =
               surface_.normal(site, sort, [&](TriangleIndex t) { return up(t); });
  }
  const Vec3f& main_normal(Site site) {
    return normal(site, surface_.is_of(site, Sort::Skin) ? Sort::Skin : Sort::Wound);
  }
  // Along the normal of a triangle, twice its area long.
  const Vec3f& up(TriangleIndex triangle) {
    auto& up = normals_.ups[triangle.value];
    if (normals_.has_up.insert(triangle.value))
      up = surface_.up(triangle, [&](Site s) { return position(s); });
    return up;
  }

  // The wound of the triangle is one that the node is on a lip of.
  bool is_of_lips(Site site, TriangleIndex triangle) const {
    return surface_.sort_of(triangle) == Sort::Wound && surface_.is_on_lip(site);
  }
  bool is_near(Site site, Site across) { return surface_.is_near(site, across); }
  bool can_meet(Site site, TriangleIndex triangle);
  ClosestPoint closest_point(Site site, TriangleIndex triangle) const;
  // Returns the closest point on the triangles at some nodes, on the first triangle of equals.
  ClosestPoint closest_point_around(Site site, std::span<const Site> around, bool is_of_lips);
  Touch touch_at(Site site, const ClosestPoint& closest);

 private:
  Vec3f normal_towards(Site site, const Vec3f& theirs);

  SelfSurface& surface_;
  const world::World& world_;
  SelfNormals& normals_;
};

}  // namespace trocar::contact
