#include "server/tissue/contact/self_surface_now.h"

#include <algorithm>
#include <cmath>

#include "common/math/nearest_point.h"
#include "server/tissue/contact/self_contact_table.h"

namespace trocar::contact {
namespace {

// Faces that touch at rest may do so for ever: a force begins this far beyond.
constexpr float kTouch_m = 2e-6f;
// A triangle's corners may move against each other so many times as far as its node may drift: its
// normal then turns by some hundredths of a radian.
constexpr float kCornerDrifts = 16;

}  // namespace

void SelfNormals::resize(const SelfSurface& surface) {
  normals.resize(2 * surface.node_count());
  has_normal.resize(2 * surface.node_count());
  ups.resize(surface.triangle_count());
  has_up.resize(surface.triangle_count());
}

void SelfNormals::begin() {
  has_normal.begin();
  has_up.begin();
}

bool SelfSurfaceNow::is_asleep(Site site, TriangleIndex triangle) const {
  return is_asleep_at(site, world_) &&
         std::ranges::all_of(surface_[triangle], [&](Site s) { return is_asleep_at(s, world_); });
}

float SelfSurfaceNow::squared_drift(Site site, TriangleIndex triangle, const Vec3f& weights) const {
  const auto& corners = surface_[triangle];
  const Vec3f& own = world_.velocities[site];
  const Vec3f of_corner[] = {world_.velocities[corners[0]] - own,
                             world_.velocities[corners[1]] - own,
                             world_.velocities[corners[2]] - own};
  float squared = length_squared(of_corner[0] * weights.x + of_corner[1] * weights.y +
                                 of_corner[2] * weights.z);
  for (const Vec3f& v : of_corner)
    squared = std::max(squared, length_squared(v) * (1 / (kCornerDrifts * kCornerDrifts)));
  return squared;
}

// Returns that normal of the node, of skin or wound, which is most opposed to `theirs`.
Vec3f SelfSurfaceNow::normal_towards(Site site, const Vec3f& theirs) {
  if (!surface_.is_of(site, Sort::Wound)) return normal(site, Sort::Skin);
  const Vec3f& of_wound = normal(site, Sort::Wound);
  if (!surface_.is_of(site, Sort::Skin)) return of_wound;
  const Vec3f& of_skin = normal(site, Sort::Skin);
  const bool is_wound =
      length_squared(of_wound) > 0 && dot(of_wound, theirs) <= dot(of_skin, theirs);
  return is_wound ? of_wound : of_skin;
}

bool SelfSurfaceNow::can_meet(Site site, TriangleIndex triangle) {
  if (surface_.is_behind(site, triangle)) return false;
  if (!is_of_lips(site, triangle)) return !surface_.is_near(site, triangle);
  return dot(up(triangle), normal(site, Sort::Wound)) < 0 && !surface_.shares_side(site, triangle);
}

SelfSurfaceNow::ClosestPoint SelfSurfaceNow::closest_point(Site site,
                                                           TriangleIndex triangle) const {
  const auto& sites = surface_[triangle];
  const Vec3f p = position(site), a = position(sites[0]), b = position(sites[1]),
              c = position(sites[2]);
  const Vec3f w = nearest_weights(p, a, b, c);
  const Vec3f from = p - (a * w.x + b * w.y + c * w.z);
  return {triangle, w, from, length_squared(from)};
}

SelfSurfaceNow::ClosestPoint SelfSurfaceNow::closest_point_around(Site site,
                                                                  std::span<const Site> around,
                                                                  bool is_of_lips) {
  ClosestPoint best;
  for (std::size_t k = 0; k < around.size(); ++k)
    for (const auto t : surface_.triangles_of(around[k])) {
      const bool is_seen = std::ranges::any_of(
          around.first(k), [&](Site s) { return std::ranges::count(surface_[t], s) > 0; });
      if (is_seen || this->is_of_lips(site, t) != is_of_lips) continue;
      const ClosestPoint closest = closest_point(site, t);
      const bool is_better = !best.triangle.is_valid() || closest.squared < best.squared ||
                             (closest.squared == best.squared && closest.triangle < best.triangle);
      if (is_better && can_meet(site, t)) best = closest;
    }
  return best;
}

SelfSurfaceNow::Touch SelfSurfaceNow::touch_at(Site site, const ClosestPoint& closest) {
  const auto& sites = surface_[closest.triangle];
  const auto sort = surface_.sort_of(closest.triangle);
  const float weights[] = {closest.weights.x, closest.weights.y, closest.weights.z};
  // Corners on a wound's front are as the triangle itself.
  const Vec3f flat = sort == Sort::Wound ? normalized(up(closest.triangle), {0, 1, 0}) : Vec3f{};
  Vec3f theirs, velocity = world_.velocities[site], rest[3];
  Touch touch;
  touch.at_rest = world_.rest_positions[site];
  for (std::size_t k = 0; k < 3; ++k) {
    const auto node = sites[k];
    const Vec3f& at_corner = normal(node, sort);
    const bool is_flat = sort == Sort::Wound && !(dot(at_corner, flat) > 0);
    theirs += (is_flat ? flat : at_corner) * weights[k];
    velocity -= world_.velocities[node] * weights[k];
    rest[k] = world_.rest_positions[node];
    touch.at_rest -= rest[k] * weights[k];
  }
  const Vec3f own = normal_towards(site, theirs);
  theirs = normalized(theirs, -own);
  touch.own = own;
  touch.facing = dot(own, theirs);
  touch.normal = normalized(theirs - own, theirs);
  touch.shift = -kTouch_m;
  if (length_squared(touch.at_rest) < kOverlapAtRest_m * kOverlapAtRest_m) {
    const Vec3f up = normalized(cross(rest[1] - rest[0], rest[2] - rest[0]), touch.normal);
    touch.shift += std::min(0.0f, dot(up, touch.at_rest));
  }
  const float along = dot(touch.normal, closest.from);
  touch.gap = along - touch.shift;
  touch.aside = std::sqrt(std::max(0.0f, closest.squared - along * along));
  touch.closing = -dot(touch.normal, velocity);
  return touch;
}

}  // namespace trocar::contact
