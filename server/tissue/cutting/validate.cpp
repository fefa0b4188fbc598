#include "server/tissue/cutting/validate.h"

#include <algorithm>
#include <string>

#include "server/tissue/cutting/star.h"

namespace trocar::cutting {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;

Error broken(const char* what, std::uint32_t index) {
  return {ErrorCode::Mismatch, std::string(what) + " " + std::to_string(index)};
}

std::vector<TetIndex> tets_of(const topology::Topology& topology) {
  std::vector<TetIndex> tets;
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t)
    if (topology.has_tet(TetIndex(t))) tets.emplace_back(t);
  return tets;
}

Status check_tets(const topology::Topology& topology) {
  std::vector<std::array<NodeIndex, 4>> all;
  for (const auto t : tets_of(topology)) {
    auto tet = topology.tet(t);
    std::array<Vec3d, 4> free;
    for (std::size_t i = 0; i < 4; ++i) {
      if (tet[i].value >= topology.node_count() || !topology.has_node(tet[i]))
        return broken("no such node in tet", t.value);
      const auto tets = topology.tets_of(tet[i]);
      if (!std::ranges::binary_search(tets, t)) return broken("a node does not know tet", t.value);
      free[i] = topology.stress_free()[tet[i].value];
    }
    if (!(six_volumes(rest_corners(topology, tet)) > 0) || !(six_volumes(free) > 0))
      return broken("no positive volume in tet", t.value);
    std::sort(tet.begin(), tet.end());
    all.push_back(tet);
  }
  std::sort(all.begin(), all.end());
  if (std::adjacent_find(all.begin(), all.end()) != all.end()) return broken("twice a tet", 0);
  return {};
}

Status check_nodes(const topology::Topology& topology) {
  for (std::uint32_t n = 0; n < topology.node_count(); ++n)
    for (const auto t : topology.tets_of(NodeIndex(n)))
      if (!topology.has_tet(t) || corner_of(topology.tet(t), NodeIndex(n)) > 3)
        return broken("a tet is not at its node", n);
  return {};
}

struct Side {
  mesh::Triangle nodes;  // ascending
  TetIndex tet;
};
std::vector<Side> sorted_sides(const topology::Topology& topology) {
  std::vector<Side> sides;
  for (const auto t : tets_of(topology))
    for (std::uint8_t corner = 0; corner < 4; ++corner) {
      auto nodes = face_nodes(topology.tet(t), corner);
      std::sort(nodes.begin(), nodes.end());
      sides.push_back({nodes, t});
    }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return a.nodes != b.nodes ? a.nodes < b.nodes : a.tet < b.tet;
  });
  return sides;
}

Status check_surface(const topology::Topology& topology) {
  const auto sides = sorted_sides(topology);
  std::vector<mesh::NodePair> edges;  // of the surface
  for (std::size_t i = 0, end = 0; i < sides.size(); i = end) {
    for (end = i; end < sides.size() && sides[end].nodes == sides[i].nodes;) ++end;
    if (end - i > 2) return broken("more than two tets at a face of tet", sides[i].tet.value);
    const auto& [a, b, c] = sides[i].nodes;
    if (end - i == 1) edges.insert(edges.end(), {{a, b}, {a, c}, {b, c}});
  }
  std::sort(edges.begin(), edges.end());
  for (std::size_t i = 0, end = 0; i < edges.size(); i = end) {
    for (end = i; end < edges.size() && edges[end] == edges[i];) ++end;
    if (end - i != 2) return broken("not two surface faces at an edge of node", edges[i][0].value);
  }
  return {};
}

Status check_links(const topology::Topology& topology) {
  const CutFaces none(topology);
  StarAnalysis analysis;
  Star star;
  for (std::uint32_t n = 0; n < topology.node_count(); ++n) {
    if (topology.tets_of(NodeIndex(n)).empty()) continue;
    analysis.run(topology, none, NodeIndex(n), star);
    if (star.component_count != 1) return broken("parts touch only in node", n);
    if (!star.twin_fans.empty()) return broken("parts touch only along an edge of node", n);
    if (!star.bad_components.empty())
      return broken("neither disc nor sphere is the link of node", n);
  }
  return {};
}

}  // namespace

Status validate(const topology::Topology& topology) {
  for (const auto check : {check_tets, check_nodes, check_surface, check_links})
    if (auto status = check(topology); !status) return status;
  return {};
}

Pieces find_pieces(const topology::Topology& topology) {
  Pieces pieces;
  pieces.piece_of_tet.assign(topology.tet_count(), kNone);
  std::vector<TetIndex> stack;
  for (const auto start : tets_of(topology)) {
    if (pieces.piece_of_tet[start.value] != kNone) continue;
    pieces.piece_of_tet[start.value] = pieces.count;
    pieces.tets.push_back(0);
    stack.push_back(start);
    while (!stack.empty()) {
      const auto t = stack.back();
      stack.pop_back();
      ++pieces.tets.back();
      for (std::uint8_t corner = 0; corner < 4; ++corner) {
        const auto other = across(topology, {t, corner});
        if (!other || pieces.piece_of_tet[other->tet.value] != kNone) continue;
        pieces.piece_of_tet[other->tet.value] = pieces.count;
        stack.push_back(other->tet);
      }
    }
    ++pieces.count;
  }
  return pieces;
}

double total_volume(const topology::Topology& topology) {
  double total = 0;
  for (const auto t : tets_of(topology))
    total += six_volumes(rest_corners(topology, topology.tet(t))) / 6;
  return total;
}

double surface_area(const topology::Topology& topology) {
  double total = 0;
  for (const auto t : tets_of(topology))
    for (std::uint8_t corner = 0; corner < 4; ++corner)
      if (!across(topology, {t, corner})) total += face_area(topology, {t, corner});
  return total;
}

}  // namespace trocar::cutting
