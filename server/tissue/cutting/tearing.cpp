#include "server/tissue/cutting/tearing.h"

#include <algorithm>
#include <cmath>

#include "common/math/symmetric.h"
#include "server/organs/organ/organ.h"
#include "server/tissue/topology/tet_shape.h"

namespace trocar::cutting {
namespace {

// A node is examined if the relative length change of an edge at it exceeds this part of the one
// that tears. In a well-shaped tet F - I is at most about twice the largest change of its edges.
constexpr double kNoticed = 0.25;

Principal stretch_at(const topology::Topology& topology, std::span<const Vec3f> displacements,
                     NodeIndex node) {
  SymMat3<double> sum;
  double volume = 0;
  for (const auto t : topology.tets_of(node)) {
    const auto& tet = topology.tet(t);
    const auto shape = topology::tet_shape(topology.rest(), tet);
    // Rows of F: gradients of the three coordinates.
    Vec3d x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
    for (std::size_t i = 0; i < 4; ++i) {
      const Vec3d u = to_double(displacements[tet[i].value]);
      x += shape.gradients[i] * u.x;
      y += shape.gradients[i] * u.y;
      z += shape.gradients[i] * u.z;
    }
    for (const auto& row : {x, y, z}) sum.add_outer(row, shape.volume);
    volume += shape.volume;
  }
  auto largest = largest_principal(sum);
  largest.value = volume > 0 ? std::sqrt(std::max(0.0, largest.value / volume)) : 0;
  return largest;
}

}  // namespace

Tearing::Tearing(const organ::Organ& organ) {
  for (std::size_t m = 0; m <= organ.regions.size(); ++m) {
    const double stretch = organ::material_at(organ, static_cast<std::uint16_t>(m)).tear_stretch;
    if (stretch > 0 && (least_stretch_ == 0 || stretch < least_stretch_)) least_stretch_ = stretch;
  }
}

bool Tearing::is_near_rest(const topology::Topology& topology, std::span<const Vec3f> displacements,
                           NodeIndex node) const {
  const double most = (least_stretch_ - 1) * kNoticed;
  const Vec3f own = displacements[node.value];
  const Vec3d& rest = topology.rest()[node.value];
  bool is_near = true;
  topology.for_each_neighbour(node, [&](NodeIndex j) {
    const auto change = static_cast<double>(length_squared(displacements[j.value] - own));
    is_near = is_near && change < most * most * length_squared(topology.rest()[j.value] - rest);
  });
  return is_near;
}

std::span<const TetFace> Tearing::find(const topology::Topology& topology,
                                       std::span<const Vec3f> displacements,
                                       std::span<const NodeIndex> nodes) {
  tears_.clear();
  faces_.clear();
  for (const auto node : nodes) {
    if (is_near_rest(topology, displacements, node)) continue;
    const double limit =
        organ::material_at(topology.organ(), topology.material_of(node)).tear_stretch;
    if (limit <= 0) continue;
    const auto largest = stretch_at(topology, displacements, node);
    if (largest.value > limit) tears_.push_back({largest.value / limit, node, largest.direction});
  }
  std::sort(tears_.begin(), tears_.end(), [](const Tear& a, const Tear& b) {
    return a.excess != b.excess ? a.excess > b.excess : a.node < b.node;
  });
  std::size_t torn = 0;
  for (const auto& tear : tears_) {
    if (torn == kMostTears) break;
    const auto before = faces_.size();
    part(topology, tear);
    if (leaves_debris(topology, std::span(faces_).subspan(before))) faces_.resize(before);
    torn += faces_.size() > before;  // where all tets are on one side, it has torn already
  }
  std::sort(faces_.begin(), faces_.end());
  faces_.erase(std::unique(faces_.begin(), faces_.end()), faces_.end());
  return faces_;
}

// Faces of tears before count as parted, too. What is opened are these or fewer, and pieces that
// share no more than nodes and edges are parted with them.
bool Tearing::leaves_debris(const topology::Topology& topology, std::span<const TetFace> faces) {
  parted_ = faces_;
  std::ranges::sort(parted_);
  return std::ranges::any_of(faces, [&](const TetFace& face) {
    return is_debris(topology, face.tet) || is_debris(topology, across(topology, face)->tet);
  });
}

bool Tearing::is_debris(const topology::Topology& topology, TetIndex tet) {
  piece_.assign(1, tet);
  for (std::size_t i = 0; i < piece_.size() && piece_.size() < kLeastTorn; ++i)
    for (std::uint8_t corner = 0; corner < 4; ++corner) {
      const TetFace face{piece_[i], corner};
      const auto other = across(topology, face);
      if (!other || std::ranges::binary_search(parted_, std::min(face, *other))) continue;
      if (std::ranges::find(piece_, other->tet) == piece_.end()) piece_.push_back(other->tet);
    }
  return piece_.size() < kLeastTorn;
}

void Tearing::part(const topology::Topology& topology, const Tear& tear) {
  const auto rest = topology.rest();
  const auto is_beyond = [&](TetIndex t) {
    double height = 0;
    for (const auto n : topology.tet(t))
      height += dot(tear.across, rest[n.value] - rest[tear.node.value]);
    return height > 0;
  };
  for (const auto t : topology.tets_of(tear.node)) {
    const auto own = corner_of(topology.tet(t), tear.node);
    for (std::uint8_t corner = 0; corner < 4; ++corner) {
      if (corner == own) continue;
      const auto other = across(topology, {t, corner});
      if (other && t < other->tet && is_beyond(t) != is_beyond(other->tet))
        faces_.push_back({t, corner});
    }
  }
}

}  // namespace trocar::cutting
