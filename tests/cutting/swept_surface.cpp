#include "tests/cutting/swept_surface.h"

#include <algorithm>
#include <bit>

namespace trocar::cutting::testing {
namespace {

constexpr std::uint8_t kEdges[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};
// Each mask holds the edges at one corner: bit i stands for kEdges[i].
constexpr std::uint8_t kAtCorner[4] = {0b000111, 0b011001, 0b101010, 0b110100};

}  // namespace

SweptSurface::SweptSurface(std::span<const Path> paths) {
  const auto add = [&](const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const auto plane = make_triangle({a, b, c});
    if (!plane) return;
    Triangle triangle{*plane, {}};
    for (const auto& p : {a, b, c}) triangle.box.include(p), box_.include(p);
    triangles_.push_back(triangle);
  };
  for (const auto& path : paths)
    for (std::size_t s = 0; s + 1 < path.size(); ++s)
      for (std::size_t i = 0; i + 1 < path[s].size(); ++i) {
        add(path[s][i], path[s][i + 1], path[s + 1][i + 1]);
        add(path[s][i], path[s + 1][i + 1], path[s + 1][i]);
      }
}

bool SweptSurface::crosses(const Vec3d& a, const Vec3d& b) const {
  Box box;
  box.include(a);
  box.include(b);
  if (!box.overlaps(box_, 0)) return false;
  return std::ranges::any_of(triangles_, [&](const Triangle& triangle) {
    if (!box.overlaps(triangle.box, 0)) return false;
    const double da = signed_distance(triangle.plane, a), db = signed_distance(triangle.plane, b);
    return da * db <= 0 && da != db && is_inside(triangle.plane, a + (b - a) * (da / (da - db)), 0);
  });
}

std::uint8_t SweptSurface::crossed_edges(const topology::Topology& topology, TetIndex tet) const {
  const auto corners = rest_corners(topology, topology.tet(tet));
  Box box;
  for (const auto& p : corners) box.include(p);
  if (!box.overlaps(box_, 0)) return 0;
  std::uint8_t crossed = 0;
  for (std::size_t e = 0; e < 6; ++e)
    if (crosses(corners[kEdges[e][0]], corners[kEdges[e][1]]))
      crossed = static_cast<std::uint8_t>(crossed | 1u << e);
  return crossed;
}

std::uint32_t SweptSurface::touched_tets(const topology::Topology& topology,
                                         std::uint32_t most) const {
  std::uint32_t touched = 0;
  for (std::uint32_t t = 0; t < topology.tet_count() && touched < most; ++t)
    touched += topology.has_tet(TetIndex(t)) && crossed_edges(topology, TetIndex(t)) != 0;
  return touched;
}

Parting parting_of(std::uint8_t crossed) {
  if (crossed == 0) return Parting::None;
  if (std::ranges::find(kAtCorner, crossed) != std::end(kAtCorner)) return Parting::OneAndThree;
  // All edges but two that do not meet.
  const bool is_quad = crossed == 0b011110 || crossed == 0b101101 || crossed == 0b110011;
  return is_quad ? Parting::TwoAndTwo : Parting::Front;
}

std::vector<std::uint32_t> count_parts(const organ::Organ& organ, const CutEvents& events) {
  topology::Topology topology(organ);
  Places places(topology);
  std::vector<std::uint32_t> root(topology.tet_count());
  for (std::uint32_t t = 0; t < root.size(); ++t) root[t] = t;
  std::vector<std::uint32_t> parts(root.size(), 1);
  std::vector<TetChild> children;
  for (std::size_t e = 0; e < events.events.size();) {
    if (const auto* const split = std::get_if<Split>(&events.events[e])) {
      split_edge(topology, places, split->a, split->b, split->t, children);
      for (const auto& [parent, child] : children) {
        if (child.value >= root.size()) root.resize(child.value + 1);
        root[child.value] = root[parent.value];
        ++parts[root[parent.value]];
      }
      ++e;
      continue;
    }
    CutEvents rest{{events.events[e]}, events.faces};
    while (++e < events.events.size() && std::holds_alternative<Duplicate>(events.events[e]))
      rest.events.push_back(events.events[e]);
    if (!apply(rest, topology, places)) return {};
  }
  return parts;
}

}  // namespace trocar::cutting::testing
