#include "server/tissue/cutting/blade_friction.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/organs/organ/organ.h"

namespace trocar::cutting {
namespace {

// Half of a blade's thickness: tissue this near to the edge lies against a side, m.
constexpr double kNear_m = 0.0005;

double distance_squared_to_segment(const Vec3d& from, const Vec3d& to, const Vec3d& p) {
  const Vec3d way = to - from;
  const double t = std::clamp(dot(p - from, way) / length_squared(way), 0.0, 1.0);
  return length_squared(p - (from + way * t));
}

Vec3d any_across(const Vec3d& v) {
  const Vec3d axis = std::abs(v.x) < 0.5 * length(v) ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  return normalized(cross(v, axis), Vec3d{});
}

// Shares of the line within a tet that is kNear_m larger on each side; begin > end: none.
std::pair<double, double> clip(const std::array<Vec3d, 4>& corners, const Vec3d& from,
                               const Vec3d& to) {
  double begin = 0, end = 1;
  for (std::size_t i = 0; i < 4; ++i) {
    const Vec3d& a = corners[(i + 1) % 4];
    Vec3d normal = cross(corners[(i + 2) % 4] - a, corners[(i + 3) % 4] - a);
    if (dot(normal, corners[i] - a) < 0) normal = -normal;
    const double near = kNear_m * length(normal);
    const double at_from = dot(normal, from - a) + near, at_to = dot(normal, to - a) + near;
    if (at_from < 0 && at_to < 0) return {1, 0};
    if (at_from < 0) begin = std::max(begin, at_from / (at_from - at_to));
    if (at_to < 0) end = std::min(end, at_from / (at_from - at_to));
  }
  return {begin, end};
}

}  // namespace

void BladeFriction::find_tets(CutMesh& mesh, const Vec3d& from, const Vec3d& to) {
  nodes_.clear();
  tets_.clear();
  const auto strip = make_triangle({from, to, (from + to) * 0.5 + any_across(to - from) * kNear_m});
  if (!strip) return;
  mesh.collect({&*strip, 1}, 1, nodes_);
  for (const auto node : nodes_) {
    // A point in a tet is no farther than 0.62 of its longest edge from a corner (Jung), so none is
    // missed in tissue up to 1.6 times as long as at rest. Of what collect() finds besides nothing
    // may follow: it is no state.
    const double reach = mesh.reach(node);
    if (distance_squared_to_segment(from, to, mesh.position(node)) > reach * reach) continue;
    const auto tets = mesh.topology().tets_of(node);
    tets_.insert(tets_.end(), tets.begin(), tets.end());
  }
  std::sort(tets_.begin(), tets_.end());
  tets_.erase(std::unique(tets_.begin(), tets_.end()), tets_.end());
}

double BladeFriction::along(CutMesh& mesh, const Vec3d& from, const Vec3d& to) {
  if (!is_blade(std::array{from, to})) return 0;
  find_tets(mesh, from, to);
  parts_.clear();
  const auto& topology = mesh.topology();
  for (const auto tet : tets_) {
    std::array<Vec3d, 4> corners;
    for (std::size_t i = 0; i < 4; ++i) corners[i] = mesh.position(topology.tet(tet)[i]);
    const auto [begin, end] = clip(corners, from, to);
    if (begin < end) parts_.push_back({begin, end, tet});
  }
  std::sort(parts_.begin(), parts_.end(), [](const Part& a, const Part& b) {
    return a.begin != b.begin ? a.begin < b.begin : a.tet < b.tet;
  });
  double covered = 0, sum = 0;  // parts overlap by what is near
  for (const auto& part : parts_) {
    if (part.end <= covered) continue;
    const auto& material = organ::material_at(topology.organ(), topology.material_of(part.tet));
    sum += (part.end - std::max(part.begin, covered)) * material.blade_friction_pa;
    covered = part.end;
  }
  return sum * length(to - from);
}

}  // namespace trocar::cutting
