#include <algorithm>
#include <string>

#include "server/organs/mesh/tet_mesh.h"

namespace trocar::mesh {
namespace {

Error broken(std::string what) {
  return {ErrorCode::BadFile, "mesh: " + std::move(what)};
}

template <typename Nodes>
std::string listed(const Nodes& nodes) {
  std::string text = "(";
  for (const NodeIndex node : nodes)
    text += (text.size() > 1 ? ", " : "") + std::to_string(node.value);
  return text + ")";
}

// Indices in range and distinct within each element.
template <typename Elements>
Status check_indices(const char* kind, const Elements& elements, std::size_t node_count) {
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const auto& nodes = elements[i];
    const std::string name = std::string(kind) + " " + std::to_string(i) + " " + listed(nodes);
    for (std::size_t a = 0; a < nodes.size(); ++a) {
      if (nodes[a].value >= node_count)
        return broken(name + " refers to node " + std::to_string(nodes[a].value) + " of " +
                      std::to_string(node_count));
      for (std::size_t b = 0; b < a; ++b)
        if (nodes[a] == nodes[b])
          return broken(name + " uses node " + std::to_string(nodes[a].value) + " twice");
    }
  }
  return {};
}

Status check_tets(const TetMesh& mesh) {
  for (std::size_t i = 0; i < mesh.tets.size(); ++i)
    if (const double volume = tet_volume(mesh, TetIndex(i)); !(volume > 0))
      return broken("tet " + std::to_string(i) + " " + listed(mesh.tets[i]) + " has volume " +
                    std::to_string(volume * 1e9) + " mm^3, must be positive");
  struct Key {
    Tet nodes;
    std::size_t tet;
  };
  std::vector<Key> keys;
  keys.reserve(mesh.tets.size());
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    keys.push_back({mesh.tets[i], i});
    std::sort(keys.back().nodes.begin(), keys.back().nodes.end());
  }
  std::sort(keys.begin(), keys.end(), [](const Key& a, const Key& b) {
    return a.nodes != b.nodes ? a.nodes < b.nodes : a.tet < b.tet;
  });
  for (std::size_t i = 1; i < keys.size(); ++i)
    if (keys[i].nodes == keys[i - 1].nodes)
      return broken("tets " + std::to_string(keys[i - 1].tet) + " and " +
                    std::to_string(keys[i].tet) + " have the same nodes " + listed(keys[i].nodes));
  return {};
}

Status check_pairs(const char* kind, const std::vector<NodePair>& pairs) {
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const std::string name = std::string(kind) + " " + std::to_string(i) + " " + listed(pairs[i]);
    if (!(pairs[i][0] < pairs[i][1])) return broken(name + " has not its smaller node first");
    if (i > 0 && pairs[i] == pairs[i - 1])
      return broken(name + " repeats " + kind + " " + std::to_string(i - 1));
    if (i > 0 && pairs[i] < pairs[i - 1]) return broken(name + " is not in lexicographic order");
  }
  return {};
}

// Each oriented face of the tets once: two tets on the same side of a face overlap, and three at a
// face always have two on one side.
Status check_tet_faces(const TetMesh& mesh) {
  struct Face {
    Triangle oriented;
    std::size_t tet;
  };
  std::vector<Face> faces;
  faces.reserve(mesh.tets.size() * 4);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const auto& [a, b, c, d] = mesh.tets[t];
    for (Triangle f :
         {Triangle{a, c, b}, Triangle{a, b, d}, Triangle{a, d, c}, Triangle{b, c, d}}) {
      std::rotate(f.begin(), std::min_element(f.begin(), f.end()), f.end());
      faces.push_back({f, t});
    }
  }
  std::sort(faces.begin(), faces.end(), [](const Face& x, const Face& y) {
    return x.oriented != y.oriented ? x.oriented < y.oriented : x.tet < y.tet;
  });
  for (std::size_t i = 1; i < faces.size(); ++i)
    if (faces[i].oriented == faces[i - 1].oriented)
      return broken("tets " + std::to_string(faces[i - 1].tet) + " and " +
                    std::to_string(faces[i].tet) + " lie on the same side of face " +
                    listed(faces[i].oriented));
  return {};
}

// Each directed edge once, its reverse once.
Status check_closed(const std::vector<Triangle>& triangles) {
  struct DirectedEdge {
    NodePair pair;
    std::size_t triangle;
  };
  std::vector<DirectedEdge> edges;
  edges.reserve(triangles.size() * 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (int i = 0; i < 3; ++i) edges.push_back({{triangles[t][i], triangles[t][(i + 1) % 3]}, t});
  std::sort(edges.begin(), edges.end(), [](const DirectedEdge& a, const DirectedEdge& b) {
    return a.pair != b.pair ? a.pair < b.pair : a.triangle < b.triangle;
  });
  for (std::size_t i = 1; i < edges.size(); ++i)
    if (edges[i].pair == edges[i - 1].pair)
      return broken("surface is not manifold: boundary triangles " +
                    std::to_string(edges[i - 1].triangle) + " and " +
                    std::to_string(edges[i].triangle) + " both run along edge " +
                    listed(edges[i].pair));
  for (const DirectedEdge& edge : edges) {
    const NodePair reverse{edge.pair[1], edge.pair[0]};
    const auto found =
        std::lower_bound(edges.begin(), edges.end(), reverse,
                         [](const DirectedEdge& a, const NodePair& pair) { return a.pair < pair; });
    if (found == edges.end() || found->pair != reverse)
      return broken("surface is open: no neighbour of boundary triangle " +
                    std::to_string(edge.triangle) + " at edge " + listed(edge.pair));
  }
  return {};
}

template <typename Item>
Status check_csr(const char* name, const Csr<NodeIndex, Item>& actual,
                 const Csr<NodeIndex, Item>& expected) {
  if (actual.offsets.size() != expected.offsets.size())
    return broken(std::string(name) + " has " + std::to_string(actual.row_count()) +
                  " rows, must have one per node");
  for (std::size_t i = 0; i + 1 < expected.offsets.size(); ++i) {
    const auto begin = expected.offsets[i], end = expected.offsets[i + 1];
    const bool same = actual.offsets[i] == begin && actual.offsets[i + 1] == end &&
                      end <= actual.items.size() &&
                      std::equal(expected.items.begin() + begin, expected.items.begin() + end,
                                 actual.items.begin() + begin);
    if (!same)
      return broken(std::string(name) + " of node " + std::to_string(i) +
                    " does not match the elements");
  }
  if (actual.items.size() != expected.items.size())
    return broken(std::string(name) + " holds items behind its last row");
  return {};
}

Status check_derived(const TetMesh& mesh) {
  TetMesh expected;
  expected.rest_positions = mesh.rest_positions;
  expected.tets = mesh.tets;
  expected.links = mesh.links;
  if (mesh.tets.empty()) expected.boundary_triangles = mesh.boundary_triangles;
  expected.build_adjacency();
  if (mesh.edges != expected.edges)
    return broken("edges are not the distinct node pairs of the tets");
  if (mesh.boundary_triangles != expected.boundary_triangles) {
    const auto [at, other] =
        std::mismatch(mesh.boundary_triangles.begin(), mesh.boundary_triangles.end(),
                      expected.boundary_triangles.begin(), expected.boundary_triangles.end());
    return broken("boundary triangle " + std::to_string(at - mesh.boundary_triangles.begin()) +
                  " is not the face that belongs to exactly one tet");
  }
  if (auto s = check_csr("node_tets", mesh.node_tets, expected.node_tets); !s) return s;
  if (auto s = check_csr("node_edges", mesh.node_edges, expected.node_edges); !s) return s;
  if (auto s = check_csr("node_links", mesh.node_links, expected.node_links); !s) return s;
  if (auto s = check_csr("node_neighbours", mesh.node_neighbours, expected.node_neighbours); !s)
    return s;
  if (mesh.is_surface_node != expected.is_surface_node)
    return broken("is_surface_node does not match the boundary triangles");
  if (mesh.surface_nodes != expected.surface_nodes)
    return broken("surface_nodes does not match the boundary triangles");
  for (std::size_t i = 0; i < mesh.node_count(); ++i) {
    const NodeIndex node(i);
    if (mesh.node_tets[node].empty() && mesh.node_links[node].empty() && !mesh.is_surface_node[i])
      return broken("node " + std::to_string(i) + " is used by no tet, link or triangle");
  }
  return {};
}

}  // namespace

Status validate(const TetMesh& mesh) {
  if (mesh.node_count() == 0) return broken("has no nodes");
  if (mesh.node_count() >= NodeIndex{}.value)
    return broken("has too many nodes for 32-bit indices");
  for (std::size_t i = 0; i < mesh.node_count(); ++i)
    if (!is_finite(mesh.rest_positions[i]))
      return broken("node " + std::to_string(i) + " has a coordinate that is not finite");
  const auto count = mesh.node_count();
  if (auto s = check_indices("tet", mesh.tets, count); !s) return s;
  if (auto s = check_indices("edge", mesh.edges, count); !s) return s;
  if (auto s = check_indices("link", mesh.links, count); !s) return s;
  if (auto s = check_indices("boundary triangle", mesh.boundary_triangles, count); !s) return s;
  if (auto s = check_tets(mesh); !s) return s;
  if (auto s = check_pairs("edge", mesh.edges); !s) return s;
  if (auto s = check_pairs("link", mesh.links); !s) return s;
  if (auto s = check_tet_faces(mesh); !s) return s;
  if (auto s = check_closed(mesh.boundary_triangles); !s) return s;
  return check_derived(mesh);
}

}  // namespace trocar::mesh
