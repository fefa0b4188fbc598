#include "server/tissue/touch/undented_surface.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/math/nearest_point.h"

namespace trocar::touch {
namespace {

constexpr float kReach_m = 0.030f;
constexpr float kRing_m = 0.015f;  // the ring around a dent begins here and ends at the reach
// More is taken when the tool has slid so far from where the surface was taken.
constexpr float kSlid_m = 0.008f;
constexpr float kForgottenPerFrame = 0.008f;  // per frame: two seconds
constexpr float kSettled = 0.0016f;  // per frame: ten seconds, in which relaxed tissue comes back
constexpr float kRingMiddle_m = 0.022f;
constexpr float kLeastFacing = 0.5f;
constexpr float kCurved_m = 0.012f;  // around a point, for its curvature
constexpr float kFaces = 0.5f;       // the cosine of what counts as facing a way
constexpr float kClear_m = 0.001f;
constexpr float kSame_m2 = 1e-10f;  // distances that differ less are equal
constexpr float kNoise_m2 = 1e-8f;  // sinking that varies less leaves the guess

// Returns how far a half space sinks there where a ball is pressed into it, or rises where it is
// pulled: far from it the dent is that of a point load, (1 - nu^2) F / (pi E r) (Boussinesq), and
// Hertz's force is 4/3 E / (1 - nu^2) sqrt(R) d^(3/2). The material cancels, whether it has relaxed
// or not.
float half_space_sinks(float depth_m, float radius_m) {
  const float deep = std::abs(depth_m);
  const float sinks =
      4 * deep * std::sqrt(deep * radius_m) / (3 * std::numbers::pi_v<float> * kRingMiddle_m);
  return std::copysign(sinks, depth_m);
}

bool is_within(const Vec3f& a, const Vec3f& b, float distance) {
  const Vec3f d = a - b;
  return dot(d, d) <= distance * distance;
}

// Returns zero for a triangle without an area.
Vec3f unit(const Vec3f& v) {
  const float size = length(v);
  return size > 0 ? v * (1 / size) : v;
}

}  // namespace

void UndentedSurface::clear() {
  triangles_.clear();
  moved_ = kept_off_ = outward_ = face_normal_ = {};
  least_facing_ = -1;
  sinks_ = motion_ = variance_ = covariance_ = 0;
}

void UndentedSurface::take_beside_wound(const world::World& world,
                                        const wire::SurfaceLayout& layout, const Vec3f& place) {
  const Vec3f outward = is_known() ? plane(place, kRing_m).normal : Vec3f{};
  clear();
  if (length_squared(outward) > 0) {
    outward_ = outward;
    least_facing_ = kLeastFacing;
    take(world, layout, place);
  }
  if (is_known()) return;
  clear();
  take(world, layout, place);
}

void UndentedSurface::take(const world::World& world, const wire::SurfaceLayout& layout,
                           const Vec3f& centre) {
  take(world, layout, centre, moved_);
}

void UndentedSurface::take(const world::World& world, const wire::SurfaceLayout& layout,
                           const Vec3f& centre, const Vec3f& motion) {
  centre_ = centre;
  kept_.swap(triangles_);
  triangles_.clear();
  auto old = kept_.begin();
  for (std::uint32_t i = 0; i < layout.triangles.size(); ++i) {
    const TriangleIndex number{i};
    while (old != kept_.end() && old->number.value < i) ++old;
    if (!layout.has_triangle(number)) continue;
    Triangle triangle{.number = number};
    for (std::size_t k = 0; k < 3; ++k) {
      triangle.nodes[k] = layout.node_of_vertex[layout.triangles[i][k].value];
      triangle.at[k] = world.position(triangle.nodes[k]) - motion;
    }
    if (!is_within(triangle.at[0], centre - moved_, kReach_m)) continue;
    // A place that was taken before the tool was there is kept.
    if (old != kept_.end() && old->number == number) triangle.at = old->at;
    shape(triangle);
    if (dot(triangle.normal, outward_) < least_facing_ * length(triangle.normal)) continue;
    triangles_.push_back(triangle);
  }
}

void UndentedSurface::shape(Triangle& triangle) {
  const auto& at = triangle.at;
  triangle.centre = (at[0] + at[1] + at[2]) * (1.0f / 3);
  triangle.normal = cross(at[1] - at[0], at[2] - at[0]);
  float farthest = 0;
  for (const auto& corner : at)
    farthest = std::max(farthest, length_squared(corner - triangle.centre));
  triangle.reach_m = std::sqrt(farthest);
}

void UndentedSurface::settle(const world::World& world, const wire::SurfaceLayout& layout,
                             const Vec3f& place) {
  if (!is_known() || has_changed(layout, place)) {
    clear();
    return take(world, layout, place);
  }
  for (auto& triangle : triangles_) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3f at = triangle.at[k] + moved_;
      triangle.at[k] = at + (world.position(triangle.nodes[k]) - at) * kSettled;
    }
    shape(triangle);
  }
  moved_ = kept_off_ = outward_ = face_normal_ = {};
  sinks_ = motion_ = 0;  // by how much more than a half space it sinks is remembered
  if (!is_within(place, centre_, kSlid_m)) take(world, layout, place);
}

bool UndentedSurface::has_changed(const wire::SurfaceLayout& layout, const Vec3f& place) const {
  return std::ranges::any_of(triangles_, [&](const Triangle& triangle) {
    return !layout.has_triangle(triangle.number) &&
           is_within(triangle.centre + moved_, place, kRing_m);
  });
}

Vec3f UndentedSurface::ring_motion(const world::World& world, const Vec3f& place) const {
  Vec3f sum;
  float weight = 0;
  for (const auto& triangle : triangles_) {
    if (is_within(triangle.centre + moved_, place, kRing_m)) continue;
    const float area = length(triangle.normal);
    Vec3f now;
    for (const auto node : triangle.nodes) now += world.position(node);
    sum += (now * (1.0f / 3) - triangle.centre) * area;
    weight += area;
  }
  return weight > 0 ? sum * (1 / weight) : moved_;
}

void UndentedSurface::follow(const world::World& world, const wire::SurfaceLayout& layout,
                             const Vec3f& core, float radius_m, bool do_others_act) {
  const auto [point, normal, node] = plane(core, kRing_m);
  outward_ = normal;
  const Vec3f ring = ring_motion(world, core);
  const float sinks = half_space_sinks(radius_m + dot(normal, point - core), radius_m);
  const float motion = dot(ring, normal);
  const float ds = sinks - sinks_, du = motion - motion_;
  sinks_ += kForgottenPerFrame * ds;
  motion_ += kForgottenPerFrame * du;
  variance_ += kForgottenPerFrame * ((1 - kForgottenPerFrame) * ds * ds - variance_);
  covariance_ += kForgottenPerFrame * ((1 - kForgottenPerFrame) * ds * du - covariance_);
  // The ring sinks with the tool; it never rises with it.
  const float share = std::max(0.0f, (kNoise_m2 - covariance_) / (kNoise_m2 + variance_));
  const Vec3f own = ring + normal * (share * sinks);
  if (do_others_act)
    moved_ = own - kept_off_;
  else
    kept_off_ = own - moved_;
  if (is_within(core, centre_, kSlid_m)) return;
  take(world, layout, core, ring);
  kept_off_ = ring_motion(world, core) + normal * (share * sinks) - moved_;
}

Vec3f UndentedSurface::nearest_on(const Triangle& triangle, const Vec3f& at) {
  const auto& [a, b, c] = triangle.at;
  const Vec3f w = nearest_weights(at, a, b, c);
  return a * w.x + b * w.y + c * w.z;
}

UndentedSurface::Nearest UndentedSurface::nearest(const Vec3f& place) const {
  Vec3f at = place - moved_;
  at += face_normal_ * std::max(0.0f, dot(face_normal_, face_point_ - at));
  Nearest nearest;
  float least = 0, faces = 0;
  for (const auto& triangle : triangles_) {
    if (!is_outside(triangle)) continue;
    const Vec3f point = nearest_on(triangle, at);
    const Vec3f away = at - point;
    const float d = dot(away, away);
    const bool is_nearer = nearest.triangle == nullptr || d < least - kSame_m2;
    if (!is_nearer && d > least + kSame_m2) continue;
    const Vec3f normal = unit(triangle.normal);
    nearest.facing = is_nearer ? normal : nearest.facing + normal;
    // On an edge it stays on the face that it was on.
    const float facing = dot(normal, face_normal_);
    if (!is_nearer && facing <= faces) continue;
    least = d;
    faces = facing;
    nearest = {&triangle, point, away, nearest.facing};
  }
  return nearest;
}

UndentedSurface::Plane UndentedSurface::plane(const Vec3f& place, float radius_m) const {
  return plane_of(nearest(place), radius_m);
}

UndentedSurface::Plane UndentedSurface::felt_plane(const Vec3f& place, float radius_m) {
  const auto found = nearest(place);
  if (found.triangle != nullptr) {
    face_point_ = found.point;
    face_normal_ = unit(found.triangle->normal);
  }
  return plane_of(found, radius_m);
}

UndentedSurface::Plane UndentedSurface::plane_of(const Nearest& nearest, float radius_m) const {
  if (nearest.triangle == nullptr)
    return {triangles_.front().at[0] + moved_, outward_, triangles_.front().nodes[0]};
  // Each counts by how near it comes, so that the normal turns without a jump.
  Vec3f normal;
  for (const auto& triangle : triangles_) {
    if (!is_outside(triangle) ||
        !is_within(triangle.centre, nearest.point, radius_m + triangle.reach_m))
      continue;
    const Vec3f away = nearest_on(triangle, nearest.point) - nearest.point;
    const float share = 1 - dot(away, away) / (radius_m * radius_m);
    if (share > 0) normal += triangle.normal * (share * share);
  }
  // A thin flap's normals may cancel out, or point away from a tool that is clearly outside.
  const bool is_clear = length_squared(outward_) == 0 &&
                        length_squared(nearest.away) > kClear_m * kClear_m &&
                        dot(nearest.facing, nearest.away) > 0;
  if (is_clear && dot(normal, nearest.away) <= 0) normal = nearest.away;
  const float size = length(normal);
  return {nearest.point + moved_, size > 0 ? normal * (1 / size) : Vec3f{0, 0, 1},
          nearest.triangle->nodes[0]};
}

std::optional<UndentedSurface::Wall> UndentedSurface::wall(const Plane& plane) const {
  const Vec3f& normal = plane.normal;
  const Vec3f at = plane.point - moved_;
  float least = -1, bent = 0, weight = 0;
  for (const auto& triangle : triangles_) {
    const float area = length(triangle.normal), facing = dot(triangle.normal, normal);
    if (facing > kFaces * area && is_within(triangle.centre, at, kCurved_m)) {
      // Under a tangent plane, the surface is lower by half the curvature times the way squared.
      const Vec3f away = triangle.centre - at;
      const float low = -dot(away, normal), way2 = dot(away, away) - low * low;
      bent += area * 2 * low * way2;
      weight += area * way2 * way2;
    } else if (facing < -kFaces * area) {
      const Vec3f down = at - nearest_on(triangle, at);
      const float far = length(down);
      if (dot(down, normal) > kFaces * far && (least < 0 || far < least)) least = far;
    }
  }
  if (least < 0) return std::nullopt;
  return Wall{least, weight > 0 ? bent / weight : 0};
}

}  // namespace trocar::touch
