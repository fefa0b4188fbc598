#include "server/tissue/topology/tie_net.h"

#include <algorithm>
#include <cmath>

#include "server/tissue/topology/edit.h"

namespace trocar::topology {
namespace {

// A place is in a triangle if it is this near to it, as a part of its longest edge.
constexpr double kNear = 1e-3;

// Returns the place's weights in the triangle if it is within it but for rounding, none otherwise.
bool weights_in(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c,
                std::array<double, 3>& weights) {
  const Vec3d u = b - a, v = c - a, n = cross(u, v), w = p - a;
  const double squared = length_squared(n);
  const double longest =
      std::sqrt(std::max({length_squared(u), length_squared(v), length_squared(c - b)}));
  if (!(squared > 0) || std::abs(dot(w, n)) > kNear * longest * std::sqrt(squared)) return false;
  const double y = dot(cross(w, v), n) / squared, z = dot(cross(u, w), n) / squared;
  weights = {1 - y - z, y, z};
  return std::ranges::min(weights) >= -kNear;
}

}  // namespace

TieNet::TieNet(const organ::Organ& organ) : triangle_count_(organ.mesh.boundary_triangles.size()) {
  const auto& mesh = organ.mesh;
  for (const auto& band : organ.ties)
    for (const auto& given : band.ties) {
      Tie tie{.law = &band.law, .area_m2 = given.area_m2};
      for (std::size_t e = 0; e < 2; ++e) {
        const auto& [triangle, weights] = given.ends[e];
        tie.ends[e] = {triangle, mesh.boundary_triangles[triangle.value], weights,
                       organ::place_of(given.ends[e], mesh, mesh.rest_positions)};
      }
      tie.rest_length_m = length(organ::place_of(given.ends[1], mesh, organ.stress_free()) -
                                 organ::place_of(given.ends[0], mesh, organ.stress_free()));
      ties_.push_back(tie);
    }
  if (ties_.empty()) return;
  at_node_.extend(mesh.node_count());
  for (std::uint32_t i = 0; i < ties_.size(); ++i) meet(i);
  at_node_.end_building();
}

std::vector<NodeIndex> TieNet::nodes() const {
  std::vector<NodeIndex> nodes;
  for (std::size_t n = 0; n < at_node_.count(); ++n)
    if (!at_node_[n].empty()) nodes.emplace_back(n);
  return nodes;
}

void TieNet::meet(std::uint32_t tie) {
  for (const auto& end : ties_[tie].ends)
    for (const auto node : end.nodes) {
      const auto count = static_cast<std::uint32_t>(at_node_[node.value].size());
      const auto list = at_node_.resize(node.value, count + 1);
      const auto at = std::lower_bound(list.begin(), list.end() - 1, tie);
      std::copy_backward(at, list.end() - 1, list.end());
      *at = tie;
    }
}

void TieNet::part(std::uint32_t tie) {
  for (const auto& end : ties_[tie].ends)
    for (const auto node : end.nodes) {
      const auto list = at_node_[node.value];
      const auto at = std::lower_bound(list.begin(), list.end(), tie);
      std::copy(at + 1, list.end(), at);
      at_node_.resize(node.value, static_cast<std::uint32_t>(list.size() - 1));
    }
}

void TieNet::follow(const SurfaceEdit& surface, std::span<const Vec3d> rest,
                    std::vector<NodeIndex>& changed) {
  const std::size_t first_added = triangle_count_;
  triangle_count_ += surface.added.size();
  if (ties_.empty()) return;
  at_node_.extend(rest.size());
  const auto move = [&](End& end) {
    double best = -1;
    for (std::size_t i = 0; i < surface.added.size(); ++i) {
      const auto& added = surface.added[i];
      std::array<double, 3> weights;
      if (added.is_wound ||
          !weights_in(end.place_m, rest[added.nodes[0].value], rest[added.nodes[1].value],
                      rest[added.nodes[2].value], weights) ||
          std::ranges::min(weights) <= best)
        continue;
      best = std::ranges::min(weights);
      for (auto& weight : weights) weight = std::max(weight, 0.0);
      const double sum = weights[0] + weights[1] + weights[2];
      for (auto& weight : weights) weight /= sum;
      end.triangle = TriangleIndex(first_added + i);
      end.nodes = added.nodes;
      end.weights = weights;
    }
    return best > -1;
  };
  const auto is_removed = [&](const End& end) {
    return std::ranges::binary_search(surface.removed, end.triangle);
  };
  const auto note = [&](const Tie& tie) {
    for (const auto& end : tie.ends)
      changed.insert(changed.end(), end.nodes.begin(), end.nodes.end());
  };
  for (std::uint32_t i = 0; i < ties_.size(); ++i) {
    Tie& tie = ties_[i];
    if (tie.is_gone || (!is_removed(tie.ends[0]) && !is_removed(tie.ends[1]))) continue;
    note(tie);
    part(i);
    for (auto& end : tie.ends)
      if (is_removed(end) && !move(end)) tie.is_gone = true;
    if (tie.is_gone) continue;
    meet(i);
    note(tie);
  }
  at_node_.tidy();
}

void follow_ties(const SurfaceEdit& surface, Topology& topology) {
  std::vector<NodeIndex> changed;
  topology.ties().follow(surface, topology.rest(), changed);
  for (const auto node : changed)
    if (topology.has_node(node)) topology.mark(node);
}

}  // namespace trocar::topology
