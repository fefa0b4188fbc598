#include "server/lab/calibration/places.h"

#include <algorithm>

#include "common/base/mix.h"

namespace trocar::calibration {
namespace {

// A place beside what is fixed tells of the support, not of the tissue.
constexpr double kFixedWeight = 4;
constexpr std::size_t kFixedStride = 7;

}  // namespace

std::vector<Place> spread_places(const organ::Organ& organ, std::size_t count, std::uint64_t seed,
                                 std::span<const Place> taken) {
  const auto& mesh = organ.mesh;
  const auto normals = mesh::surface_normals(mesh);
  std::vector<NodeIndex> candidates;
  for (const auto node : mesh.surface_nodes)
    if (!std::ranges::binary_search(organ.fixed_nodes, node)) candidates.push_back(node);
  std::vector<double> far(candidates.size(), 1e30);
  const auto position = [&](NodeIndex node) { return mesh.rest_positions[node.value]; };
  const auto keep_away = [&](const Vec3d& from, double weight) {
    for (std::size_t i = 0; i < candidates.size(); ++i)
      far[i] = std::min(far[i], weight * length_squared(position(candidates[i]) - from));
  };
  for (std::size_t i = 0; i < organ.fixed_nodes.size(); i += kFixedStride)
    keep_away(position(organ.fixed_nodes[i]), kFixedWeight);
  for (const auto& place : taken) keep_away(position(place.node), 1);

  std::vector<Place> places;
  if (candidates.empty()) return places;
  std::size_t next = splitmix64(seed) % candidates.size();
  if (!taken.empty()) next = static_cast<std::size_t>(std::ranges::max_element(far) - far.begin());
  while (places.size() < std::min(count, candidates.size())) {
    const auto node = candidates[next];
    places.push_back({node, to_float(position(node)), to_float(normals[node.value])});
    keep_away(position(node), 1);
    next = static_cast<std::size_t>(std::ranges::max_element(far) - far.begin());
  }
  return places;
}

double surface_edge_m(const organ::Organ& organ) {
  const auto& mesh = organ.mesh;
  double sum = 0;
  std::size_t count = 0;
  for (const auto& triangle : mesh.boundary_triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      sum += length(mesh.rest_positions[triangle[i].value] -
                    mesh.rest_positions[triangle[(i + 1) % 3].value]);
      ++count;
    }
  return count > 0 ? sum / static_cast<double>(count) : 0;
}

}  // namespace trocar::calibration
