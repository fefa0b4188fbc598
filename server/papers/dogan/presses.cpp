#include "server/papers/dogan/presses.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace trocar::dogan {
namespace {

constexpr std::size_t kPullEvery = 5;
// Azimuths that never repeat.
constexpr double kGoldenAngle = std::numbers::pi * (3 - 2.23606797749979);

const Vec3d& position(const organ::Organ& organ, NodeIndex node) {
  return organ.mesh.rest_positions[node.value];
}

// Gives each node a third of the area of each of its boundary triangles.
std::vector<double> node_areas(const mesh::TetMesh& mesh) {
  std::vector<double> areas(mesh.node_count(), 0.0);
  for (const auto& [a, b, c] : mesh.boundary_triangles) {
    const auto& p = mesh.rest_positions;
    const double area = length(cross(p[b.value] - p[a.value], p[c.value] - p[a.value])) / 2;
    for (const auto node : {a, b, c}) areas[node.value] += area / 3;
  }
  return areas;
}

}  // namespace

std::vector<NodeForce> node_forces(const organ::Organ& organ, const Press& press) {
  if (press.radius_m == 0) return {{press.node, press.force_n}};
  const auto areas = node_areas(organ.mesh);
  const auto normals = mesh::surface_normals(organ.mesh);
  std::vector<NodeForce> forces;
  double sum = 0;
  for (const auto node : organ.mesh.surface_nodes) {
    if (length(position(organ, node) - position(organ, press.node)) > press.radius_m ||
        dot(normals[node.value], normals[press.node.value]) <= 0)
      continue;
    forces.push_back({node, press.force_n * areas[node.value]});
    sum += areas[node.value];
  }
  for (auto& force : forces) force.force_n = force.force_n / sum;
  return forces;
}

std::vector<NodeIndex> accessible_nodes(const organ::Organ& organ, double radius_m) {
  std::vector<NodeIndex> free, far;
  for (const auto node : organ.mesh.surface_nodes) {
    if (std::ranges::binary_search(organ.fixed_nodes, node)) continue;
    free.push_back(node);
    if (std::ranges::none_of(organ.fixed_nodes, [&](NodeIndex fixed) {
          return length(position(organ, fixed) - position(organ, node)) <= radius_m;
        }))
      far.push_back(node);
  }
  return far.empty() ? free : far;
}

std::vector<NodeIndex> spread_nodes(const organ::Organ& organ,
                                    std::span<const NodeIndex> candidates, std::size_t count,
                                    std::uint64_t seed, std::span<const NodeIndex> taken) {
  std::vector<NodeIndex> nodes;
  if (candidates.empty()) return nodes;
  std::vector<double> far(candidates.size(), std::numeric_limits<double>::infinity());
  const auto keep_away = [&](NodeIndex from) {
    for (std::size_t i = 0; i < candidates.size(); ++i)
      far[i] =
          std::min(far[i], length_squared(position(organ, candidates[i]) - position(organ, from)));
  };
  for (const auto node : taken) keep_away(node);
  const auto farthest = [&] {
    return static_cast<std::size_t>(std::ranges::max_element(far) - far.begin());
  };
  std::size_t next = taken.empty() ? seed % candidates.size() : farthest();
  while (nodes.size() < std::min(count, candidates.size())) {
    nodes.push_back(candidates[next]);
    keep_away(candidates[next]);
    next = farthest();
  }
  return nodes;
}

std::vector<Vec3d> press_directions(const Vec3d& outward, std::size_t first, std::size_t count,
                                    double slant_rad) {
  const Vec3d axis = std::abs(outward.x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  const Vec3d a = cross(outward, axis) / length(cross(outward, axis)), b = cross(outward, a);
  std::vector<Vec3d> directions;
  for (std::size_t i = 0; i < count; ++i) {
    const double azimuth = kGoldenAngle * static_cast<double>(first + i);
    const double slant = i == 0 ? 0 : slant_rad;
    const Vec3d in = outward * -std::cos(slant) +
                     (a * std::cos(azimuth) + b * std::sin(azimuth)) * std::sin(slant);
    directions.push_back((first + i) % kPullEvery == kPullEvery - 1 ? in * -1.0 : in);
  }
  return directions;
}

}  // namespace trocar::dogan
