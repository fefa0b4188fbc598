#include "server/tissue/contact/surface.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/math/morton.h"
#include "server/tissue/contact/contact_list.h"

namespace trocar::contact {
namespace {

constexpr std::size_t kBundleTriangles = 16;

using QuadraturePoints = std::vector<std::array<float, 3>>;

// The rows of a triangle cut into n^2: upright parts at (i, j) with i + j < n, and between them
// those that stand on their tip.
QuadraturePoints centres(std::uint32_t n) {
  QuadraturePoints result;
  const float part = 1.0f / static_cast<float>(n);
  const auto add = [&](std::uint32_t i, std::uint32_t j, float offset) {
    const float a = (static_cast<float>(i) + offset) * part;
    const float b = (static_cast<float>(j) + offset) * part;
    result.push_back({a, b, 1.0f - a - b});
  };
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t j = 0; i + j < n; ++j) {
      add(i, j, 1.0f / 3.0f);
      if (i + j + 1 < n) add(i, j, 2.0f / 3.0f);
    }
  return result;
}

std::array<QuadraturePoints, kMaxDivisions + 1> all_centres() {
  std::array<QuadraturePoints, kMaxDivisions + 1> result;
  result.back() = centres(kFineDivisions);
  for (std::uint32_t n = 1; n <= kMaxDivisions; ++n) result[n - 1] = centres(n);
  return result;
}

}  // namespace

std::span<const std::array<float, 3>> quadrature_points(std::uint32_t divisions) {
  static const auto points = all_centres();
  return divisions == kFineDivisions ? points.back() : points[divisions - 1];
}

namespace {

template <typename V>
SurfaceTriangle triangle_of(const std::array<NodeIndex, 3>& nodes, const V& a, const V& b,
                            const V& c) {
  const auto longest = std::max({length(b - a), length(c - b), length(a - c)});
  return {nodes, static_cast<float>(length(cross(b - a, c - a)) / 2), static_cast<float>(longest)};
}

}  // namespace

Surface::Surface(const organ::Organ& organ) {
  const auto& mesh = organ.mesh;
  std::vector<Vec3d> centroids;
  for (const auto& nodes : mesh.boundary_triangles) {
    const Vec3d a = mesh.rest_positions[nodes[0].value], b = mesh.rest_positions[nodes[1].value],
                c = mesh.rest_positions[nodes[2].value];
    triangles_.push_back(triangle_of(nodes, a, b, c));
    centroids.push_back((a + b + c) / 3);
  }
  bundle_of_.resize(triangles_.size());
  for (const auto t : morton_order(centroids)) order_.push_back(TriangleIndex(t));
  for (std::size_t first = 0; first < order_.size(); first += kBundleTriangles)
    add_bundle(first, std::min(first + kBundleTriangles, order_.size()));
}

// Adds the bundle of these entries of order_.
void Surface::add_bundle(std::size_t first, std::size_t last) {
  Bundle bundle{.first_triangle = static_cast<std::uint32_t>(first),
                .last_triangle = static_cast<std::uint32_t>(last),
                .first_node = static_cast<std::uint32_t>(nodes_.size()),
                .triangles = static_cast<std::uint32_t>(last - first)};
  for (auto i = first; i < last; ++i) {
    bundle_of_[order_[i].value] = static_cast<std::uint32_t>(bundles_.size());
    for (const auto node : triangles_[order_[i].value].nodes) nodes_.push_back(node);
  }
  const auto begin = nodes_.begin() + bundle.first_node;
  std::sort(begin, nodes_.end());
  nodes_.erase(std::unique(begin, nodes_.end()), nodes_.end());
  bundle.last_node = static_cast<std::uint32_t>(nodes_.size());
  bundles_.push_back(bundle);
}

void Surface::update(const topology::SurfaceEdit& edit, const world::World& world) {
  for (const auto triangle : edit.removed) {
    triangles_[triangle.value] = {};
    --bundles_[bundle_of_[triangle.value]].triangles;
  }
  const auto begin = order_.size();
  for (const auto& added : edit.added) {
    const auto& p = world.rest_positions;
    const auto& [a, b, c] = added.nodes;
    order_.emplace_back(triangles_.size());
    triangles_.push_back(triangle_of(added.nodes, p[a.value], p[b.value], p[c.value]));
  }
  bundle_of_.resize(triangles_.size());
  for (std::size_t first = begin; first < order_.size(); first += kBundleTriangles)
    add_bundle(first, std::min(first + kBundleTriangles, order_.size()));
}

void Surface::collect(const Box& box, const world::World& world, double travel_m,
                      std::vector<TriangleIndex>& found) {
  found.clear();
  for (auto& bundle : bundles_) {
    if (bundle.triangles == 0) continue;
    Box reached = bundle.box;
    reached.grow(static_cast<float>(travel_m - bundle.travel_m) + kRounding_m);
    if (bundle.has_box && !reached.overlaps(box)) continue;
    bundle.has_box = true;
    bundle.travel_m = travel_m;
    bundle.box = {};
    for (auto i = bundle.first_node; i < bundle.last_node; ++i)
      bundle.box.include(world.position(nodes_[i]));
    if (!bundle.box.overlaps(box)) continue;
    for (auto i = bundle.first_triangle; i < bundle.last_triangle; ++i) {
      const auto& nodes = triangles_[order_[i].value].nodes;
      if (!nodes[0].is_valid()) continue;
      Box own;
      for (const auto node : nodes) own.include(world.position(node));
      if (own.overlaps(box)) found.push_back(order_[i]);
    }
  }
  std::ranges::sort(found);
}

}  // namespace trocar::contact
