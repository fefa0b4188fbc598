#include "server/tissue/cutting/faces.h"

#include <algorithm>

namespace trocar::cutting {

std::optional<TetFace> across(const topology::Topology& topology, const TetFace& face) {
  const auto nodes = face_nodes(topology.tet(face.tet), face.corner);
  auto shortest = topology.tets_of(nodes[0]);
  for (std::size_t i = 1; i < 3; ++i)
    if (const auto tets = topology.tets_of(nodes[i]); tets.size() < shortest.size())
      shortest = tets;
  for (const auto t : shortest) {
    if (t == face.tet) continue;
    const auto& tet = topology.tet(t);
    std::uint8_t opposite = 0;  // sum of the other corners, subtracted from 0 + 1 + 2 + 3
    bool is_shared = true;
    for (const auto node : nodes) {
      const auto corner = corner_of(tet, node);
      is_shared = is_shared && corner < 4;
      opposite = static_cast<std::uint8_t>(opposite + corner);
    }
    if (is_shared) return TetFace{t, static_cast<std::uint8_t>(6 - opposite)};
  }
  return std::nullopt;
}

void ring_of(const topology::Topology& topology, NodeIndex a, NodeIndex b,
             std::vector<TetIndex>& out) {
  out.clear();
  for (const auto t : topology.tets_of(a))
    if (corner_of(topology.tet(t), b) < 4) out.push_back(t);
}

double face_area(const topology::Topology& topology, const TetFace& face) {
  const auto nodes = face_nodes(topology.tet(face.tet), face.corner);
  const auto at = [&](std::size_t i) { return topology.rest()[nodes[i].value]; };
  return length(cross(at(1) - at(0), at(2) - at(0))) / 2;
}

double six_volumes(const std::array<Vec3d, 4>& corners) {
  const auto& [a, b, c, d] = corners;
  return dot(cross(b - a, c - a), d - a);
}

double least_sine(const std::array<Vec3d, 4>& corners) {
  const double volume = six_volumes(corners);
  std::array<double, 4> doubled_areas_squared;  // of the face opposite to each corner
  for (std::size_t i = 0; i < 4; ++i) {
    const auto &a = corners[(i + 1) % 4], &b = corners[(i + 2) % 4], &c = corners[(i + 3) % 4];
    doubled_areas_squared[i] = length_squared(cross(b - a, c - a));
  }
  double least_squared = 1;
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = i + 1; j < 4; ++j) {
      // The edge that the faces opposite to i and j share joins the two other corners.
      const std::size_t k = i == 0 ? (j == 1 ? 2 : 1) : 0, l = 6 - i - j - k;
      const double areas = doubled_areas_squared[i] * doubled_areas_squared[j];
      if (!(areas > 0)) return -1;
      const double squared = length_squared(corners[k] - corners[l]) / areas;
      least_squared = std::min(least_squared, squared * volume * volume);
    }
  const double sine = std::sqrt(least_squared);
  return volume > 0 ? sine : -sine;
}

std::array<Vec3d, 4> rest_corners(const topology::Topology& topology, const mesh::Tet& tet) {
  std::array<Vec3d, 4> corners;
  for (std::size_t i = 0; i < 4; ++i) corners[i] = topology.rest()[tet[i].value];
  return corners;
}

std::uint16_t quantised_share(double share) {
  return static_cast<std::uint16_t>(std::clamp(std::floor(share * 65536 + 0.5), 0.0, 65535.0));
}

}  // namespace trocar::cutting
