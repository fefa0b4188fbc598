#include "server/organs/mesh/tet_stars.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace trocar::mesh {
namespace {

bool has_node(const Tet& tet, NodeIndex node) {
  return tet[0] == node || tet[1] == node || tet[2] == node || tet[3] == node;
}

}  // namespace

ShapeBound ShapeBound::of_degrees(double min_deg, double max_deg) {
  return {std::cos(min_deg * std::numbers::pi / 180), std::cos(max_deg * std::numbers::pi / 180)};
}

TetStars::TetStars(std::vector<Vec3d> positions, std::vector<Tet> tets)
    : positions_(std::move(positions)), tets_(std::move(tets)) {
  stars_.resize(positions_.size());
  is_on_surface_.assign(positions_.size(), 0);
  std::vector<std::array<NodeIndex, 3>> faces;
  faces.reserve(4 * tets_.size());
  for (std::uint32_t t = 0; t < tets_.size(); ++t) {
    for (const NodeIndex node : tets_[t]) stars_[node.value].push_back(t);
    for (const auto& [i, j, k] : kTetFaces) {
      std::array<NodeIndex, 3> face{tets_[t][i], tets_[t][j], tets_[t][k]};
      std::sort(face.begin(), face.end());
      faces.push_back(face);
    }
  }
  std::sort(faces.begin(), faces.end());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    if (f + 1 < faces.size() && faces[f] == faces[f + 1]) {
      ++f;
      continue;
    }
    for (const NodeIndex node : faces[f]) is_on_surface_[node.value] = 1;
  }
}

std::vector<std::uint32_t> TetStars::tets_at(NodeIndex a, NodeIndex b) const {
  std::vector<std::uint32_t> out;
  for (const auto t : stars_[a.value])
    if (has_node(tets_[t], b)) out.push_back(t);
  return out;
}

bool TetStars::is_surface_edge(NodeIndex a, NodeIndex b) const {
  if (!is_on_surface(a) || !is_on_surface(b)) return false;
  // Around an edge within, each opposite node is in two tets.
  std::vector<NodeIndex> opposite;
  for (const auto t : tets_at(a, b))
    for (const NodeIndex node : tets_[t])
      if (node != a && node != b) opposite.push_back(node);
  std::sort(opposite.begin(), opposite.end());
  for (std::size_t i = 0; i < opposite.size(); i += 2)
    if (i + 1 == opposite.size() || opposite[i] != opposite[i + 1]) return true;
  return false;
}

std::vector<NodeIndex> TetStars::neighbours(NodeIndex node) const {
  std::vector<NodeIndex> out;
  for (const auto t : stars_[node.value])
    for (const NodeIndex other : tets_[t])
      if (other != node) out.push_back(other);
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

bool TetStars::is_within(const Tet& tet, NodeIndex moved, const Vec3d& to,
                         const ShapeBound& bound) const {
  std::array<Vec3d, 4> p;
  for (std::size_t i = 0; i < 4; ++i) p[i] = tet[i] == moved ? to : positions_[tet[i].value];
  if (!(dot(cross(p[1] - p[0], p[2] - p[0]), p[3] - p[0]) > 0)) return false;
  std::array<Vec3d, 4> normals;
  for (std::size_t f = 0; f < 4; ++f) {
    const auto& [i, j, k] = kTetFaces[f];
    const Vec3d normal = cross(p[j] - p[i], p[k] - p[i]);
    const double size = length(normal);
    if (!(size > 0)) return false;
    normals[f] = normal / size;
  }
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const double cosine = -dot(normals[i], normals[j]);
      if (!(cosine <= bound.smallest_angle_cosine && cosine >= bound.largest_angle_cosine))
        return false;
    }
  return true;
}

bool TetStars::can_move(NodeIndex node, const Vec3d& to, const ShapeBound& bound) const {
  return std::ranges::all_of(stars_[node.value],
                             [&](std::uint32_t t) { return is_within(tets_[t], node, to, bound); });
}

bool TetStars::can_split(NodeIndex a, NodeIndex b, const Vec3d& at, const ShapeBound& bound) const {
  return std::ranges::all_of(stars_[a.value], [&](std::uint32_t t) {
    return !has_node(tets_[t], b) ||
           (is_within(tets_[t], a, at, bound) && is_within(tets_[t], b, at, bound));
  });
}

NodeIndex TetStars::split(NodeIndex a, NodeIndex b, const Vec3d& at) {
  const bool is_surface = is_surface_edge(a, b);
  const NodeIndex middle(positions_.size());
  positions_.push_back(at);
  is_on_surface_.push_back(is_surface ? 1 : 0);
  stars_.emplace_back();
  for (const auto t : tets_at(a, b)) {
    const auto other = static_cast<std::uint32_t>(tets_.size());
    Tet with_b = tets_[t];
    std::replace(with_b.begin(), with_b.end(), a, middle);
    std::replace(tets_[t].begin(), tets_[t].end(), b, middle);
    tets_.push_back(with_b);
    for (const NodeIndex node : with_b)
      if (node == b)
        std::replace(stars_[b.value].begin(), stars_[b.value].end(), t, other);
      else
        stars_[node.value].push_back(other);
    stars_[middle.value].push_back(t);
  }
  return middle;
}

}  // namespace trocar::mesh
