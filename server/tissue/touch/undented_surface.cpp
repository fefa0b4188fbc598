#include "server/tissue/touch/undented_surface.h"

#include <algorithm>
#include <cmath>

#include "server/tissue/contact/nearest_point.h"

namespace trocar::touch {
namespace {

constexpr float kReach_m = 0.030f;
constexpr float kRing_m = 0.015f;  // the ring around a dent begins here and ends at the reach
// More is taken when the tool has slid so far from where the surface was taken.
constexpr float kSlid_m = 0.008f;
constexpr float kForgottenPerFrame = 0.008f;  // per frame: two seconds
constexpr float kSettled = 0.0016f;  // per frame: ten seconds, in which relaxed tissue comes back
constexpr float kForceNoise = 0.0004f;  // N^2; forces that vary less leave the guess of sinking

bool is_within(const Vec3f& a, const Vec3f& b, float distance) {
  const Vec3f d = a - b;
  return dot(d, d) <= distance * distance;
}

}  // namespace

void UndentedSurface::clear() {
  triangles_.clear();
  moved_ = {};
  force_ = motion_ = variance_ = covariance_ = 0;
}

void UndentedSurface::take(const world::World& world, const wire::SurfaceLayout& layout,
                           const Vec3f& centre) {
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
      triangle.at[k] = world.position(triangle.nodes[k]) - moved_;
    }
    if (!is_within(triangle.at[0], centre - moved_, kReach_m)) continue;
    // A place that was taken before the tool was there is kept.
    if (old != kept_.end() && old->number == number) triangle.at = old->at;
    shape(triangle);
    triangles_.push_back(triangle);
  }
}

void UndentedSurface::shape(Triangle& triangle) {
  const auto& at = triangle.at;
  triangle.centre = (at[0] + at[1] + at[2]) * (1.0f / 3);
  triangle.normal = cross(at[1] - at[0], at[2] - at[0]);
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
  moved_ = {};
  force_ = motion_ = 0;  // how far it sinks per force is remembered
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
                             const Vec3f& place, const Vec3f& force_n, float sinks_m_n) {
  const Vec3f normal = plane(place, kRing_m).normal;
  const Vec3f ring = ring_motion(world, place);
  const float force = dot(force_n, normal), motion = dot(ring, normal);
  const float df = force - force_, du = motion - motion_;
  force_ += kForgottenPerFrame * df;
  motion_ += kForgottenPerFrame * du;
  variance_ += kForgottenPerFrame * ((1 - kForgottenPerFrame) * df * df - variance_);
  covariance_ += kForgottenPerFrame * ((1 - kForgottenPerFrame) * df * du - covariance_);
  // The tissue sinks against the force on the tool; it never rises with it.
  const float sinks =
      std::max(0.0f, (kForceNoise * sinks_m_n - covariance_) / (kForceNoise + variance_));
  moved_ = ring + normal * (sinks * force);
  if (!is_within(place, centre_, kSlid_m)) take(world, layout, place);
}

UndentedSurface::Plane UndentedSurface::plane(const Vec3f& place, float radius_m) const {
  const Vec3f at = place - moved_;
  Vec3f nearest;
  const Triangle* of = nullptr;
  float least = 0;
  for (const auto& triangle : triangles_) {
    const auto& [a, b, c] = triangle.at;
    const Vec3f w = contact::nearest_weights(at, a, b, c);
    const Vec3f point = a * w.x + b * w.y + c * w.z;
    const Vec3f away = at - point;
    if (const float d = dot(away, away); of == nullptr || d < least) {
      least = d;
      nearest = point;
      of = &triangle;
    }
  }
  Vec3f normal = of->normal;
  for (const auto& triangle : triangles_) {
    if (&triangle == of) continue;
    const Vec3f away = triangle.centre - nearest;
    const float share = 1 - dot(away, away) / (radius_m * radius_m);
    if (share > 0) normal += triangle.normal * (share * share);
  }
  const float size = length(normal);
  return {nearest + moved_, size > 0 ? normal * (1 / size) : Vec3f{0, 0, 1}, of->nodes[0]};
}

}  // namespace trocar::touch
