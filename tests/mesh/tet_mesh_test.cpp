#include "server/organs/mesh/tet_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "tests/mesh/block_mesh.h"

namespace trocar::mesh {
namespace {

using trocar::testing::block_mesh;

TetMesh one_tet() {
  TetMesh mesh;
  mesh.rest_positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.tets = {{NodeIndex(0), NodeIndex(1), NodeIndex(2), NodeIndex(3)}};
  mesh.build_adjacency();
  return mesh;
}

// Two loose triangles back to back, held by links.
TetMesh pillow() {
  TetMesh mesh;
  mesh.rest_positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.links = {
      {NodeIndex(0), NodeIndex(1)}, {NodeIndex(1), NodeIndex(2)}, {NodeIndex(0), NodeIndex(2)}};
  mesh.boundary_triangles = {{NodeIndex(0), NodeIndex(1), NodeIndex(2)},
                             {NodeIndex(0), NodeIndex(2), NodeIndex(1)}};
  mesh.build_adjacency();
  return mesh;
}

TEST(TetMesh, OneTetHasOutwardFacesAndKnownMeasures) {
  const TetMesh mesh = one_tet();
  ASSERT_TRUE(validate(mesh)) << validate(mesh).error().message;
  EXPECT_EQ(mesh.edges.size(), 6u);
  EXPECT_EQ(mesh.boundary_triangles.size(), 4u);
  EXPECT_DOUBLE_EQ(total_volume(mesh), 1.0 / 6);
  const Vec3d centre{0.25, 0.25, 0.25};
  for (const auto& [a, b, c] : mesh.boundary_triangles) {
    const Vec3d& p = mesh.rest_positions[a.value];
    const Vec3d n = cross(mesh.rest_positions[b.value] - p, mesh.rest_positions[c.value] - p);
    EXPECT_GT(dot(n, p - centre), 0);
  }
  const DihedralRange angles = dihedral_range(mesh);
  EXPECT_NEAR(angles.min_deg, 54.7356103, 1e-6);  // acos(1 / sqrt 3)
  EXPECT_NEAR(angles.max_deg, 90, 1e-6);
}

TEST(TetMesh, AdjacencyEqualsBruteForce) {
  for (const int n : {1, 2, 4}) {
    const TetMesh mesh = block_mesh(n, 0.01);
    ASSERT_TRUE(validate(mesh)) << validate(mesh).error().message;
    EXPECT_NEAR(total_volume(mesh), std::pow(n * 0.01, 3), 1e-15);
    EXPECT_EQ(mesh.boundary_triangles.size(), 12u * n * n);
    std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
    for (const Tet& tet : mesh.tets)
      for (const NodeIndex a : tet)
        for (const NodeIndex b : tet)
          if (a < b) edges.insert({a.value, b.value});
    ASSERT_EQ(mesh.edges.size(), edges.size());
    std::size_t at = 0;
    for (const auto& [a, b] : edges) {
      EXPECT_EQ(mesh.edges[at][0].value, a);
      EXPECT_EQ(mesh.edges[at][1].value, b);
      ++at;
    }
    for (std::size_t i = 0; i < mesh.node_count(); ++i) {
      const NodeIndex node(i);
      std::vector<TetIndex> tets;
      for (std::size_t t = 0; t < mesh.tets.size(); ++t)
        if (std::count(mesh.tets[t].begin(), mesh.tets[t].end(), node)) tets.push_back(TetIndex(t));
      EXPECT_TRUE(std::ranges::equal(mesh.node_tets[node], tets));
      std::vector<EdgeIndex> node_edges;
      std::vector<NodeIndex> neighbours;
      for (std::size_t e = 0; e < mesh.edges.size(); ++e) {
        const auto [a, b] = mesh.edges[e];
        if (a == node || b == node) {
          node_edges.push_back(EdgeIndex(e));
          neighbours.push_back(a == node ? b : a);
        }
      }
      std::sort(neighbours.begin(), neighbours.end());
      EXPECT_TRUE(std::ranges::equal(mesh.node_edges[node], node_edges));
      EXPECT_TRUE(std::ranges::equal(mesh.node_neighbours[node], neighbours));
      const Vec3d p = mesh.rest_positions[i] * (1 / (n * 0.005));
      const bool outside = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) > 1 - 1e-9;
      EXPECT_EQ(mesh.is_surface_node[i] != 0, outside);
    }
  }
}

TEST(TetMesh, NormalsPointOutwardWithUnitLength) {
  const TetMesh mesh = block_mesh(3, 0.02);
  const auto normals = surface_normals(mesh);
  for (std::size_t i = 0; i < mesh.node_count(); ++i) {
    EXPECT_NEAR(length(normals[i]), mesh.is_surface_node[i] ? 1 : 0, 1e-12);
    if (mesh.is_surface_node[i]) {
      EXPECT_GT(dot(normals[i], mesh.rest_positions[i]), 0);
    }
  }
}

TEST(TetMesh, LinksCarrySpringsWhereThereAreAny) {
  TetMesh mesh = one_tet();
  EXPECT_EQ(&mesh.spring_pairs(), &mesh.edges);
  mesh.links = {{NodeIndex(1), NodeIndex(3)}, {NodeIndex(0), NodeIndex(2)}};
  mesh.build_adjacency();
  ASSERT_TRUE(validate(mesh)) << validate(mesh).error().message;
  EXPECT_EQ(&mesh.spring_pairs(), &mesh.links);
  EXPECT_EQ(mesh.links[0][0], NodeIndex(0));
  EXPECT_EQ(mesh.node_neighbours[NodeIndex(0)].size(), 1u);
}

struct Breakage {
  const char* name;
  std::function<TetMesh()> make;
  const char* expected;  // part of the message
};

class Validate : public ::testing::TestWithParam<Breakage> {};

TEST_P(Validate, NamesTheBrokenInvariant) {
  const Status status = validate(GetParam().make());
  ASSERT_FALSE(status.ok());
  EXPECT_NE(status.error().message.find(GetParam().expected), std::string::npos)
      << status.error().message;
}

TetMesh changed(const std::function<void(TetMesh&)>& change) {
  TetMesh mesh = block_mesh(2, 0.01);
  change(mesh);
  return mesh;
}
TetMesh rebuilt(const std::function<void(TetMesh&)>& change) {
  TetMesh mesh = changed(change);
  mesh.build_adjacency();
  return mesh;
}

INSTANTIATE_TEST_SUITE_P(
    Mesh, Validate,
    ::testing::Values(
        Breakage{"NoNodes", [] { return TetMesh{}; }, "has no nodes"},
        Breakage{"NotFinite",
                 [] { return changed([](TetMesh& m) { m.rest_positions[5].y = NAN; }); },
                 "node 5 has a coordinate that is not finite"},
        Breakage{"TetIndex",
                 [] { return changed([](TetMesh& m) { m.tets[7][2] = NodeIndex(99); }); }, "tet 7"},
        Breakage{"EdgeIndex",
                 [] { return changed([](TetMesh& m) { m.edges[3][1] = NodeIndex(99); }); },
                 "edge 3"},
        Breakage{"LinkIndex",
                 [] {
                   return changed([](TetMesh& m) { m.links = {{NodeIndex(0), NodeIndex(27)}}; });
                 },
                 "refers to node 27 of 27"},
        Breakage{
            "TriangleIndex",
            [] { return changed([](TetMesh& m) { m.boundary_triangles[1][0] = NodeIndex(99); }); },
            "boundary triangle 1"},
        Breakage{"RepeatedNode",
                 [] { return changed([](TetMesh& m) { m.tets[4][1] = m.tets[4][0]; }); }, "tet 4"},
        Breakage{"Inverted",
                 [] { return rebuilt([](TetMesh& m) { std::swap(m.tets[9][0], m.tets[9][1]); }); },
                 "tet 9"},
        Breakage{
            "Flat",
            [] { return changed([](TetMesh& m) { m.rest_positions[0] = m.rest_positions[1]; }); },
            "must be positive"},
        Breakage{"TetTwice",
                 [] {
                   return rebuilt([](TetMesh& m) {
                     const auto [a, b, c, d] = m.tets[3];
                     m.tets.push_back({b, c, a, d});
                   });
                 },
                 "tets 3 and 48 have the same nodes"},
        Breakage{"ThreeAtAFace",
                 [] {
                   return rebuilt([](TetMesh& m) {
                     const auto [a, b, c] = m.boundary_triangles[0];
                     const Vec3d& p = m.rest_positions[a.value];
                     const Vec3d& q = m.rest_positions[b.value];
                     const Vec3d& r = m.rest_positions[c.value];
                     const Vec3d top = (p + q + r) / 3 + normalized(cross(q - p, r - p), {}) * 0.01;
                     for (int i = 1; i <= 2; ++i) {
                       m.rest_positions.push_back(top * (0.9 + 0.1 * i));
                       m.tets.push_back({a, b, c, NodeIndex(m.node_count() - 1)});
                     }
                   });
                 },
                 "lie on the same side of face"},
        Breakage{"EdgeOrder",
                 [] { return changed([](TetMesh& m) { std::swap(m.edges[3], m.edges[4]); }); },
                 "edge 4"},
        Breakage{
            "EdgeDirection",
            [] { return changed([](TetMesh& m) { std::swap(m.edges[3][0], m.edges[3][1]); }); },
            "edge 3"},
        Breakage{"EdgeMissing", [] { return changed([](TetMesh& m) { m.edges.pop_back(); }); },
                 "edges are not"},
        Breakage{"LinkTwice",
                 [] {
                   return rebuilt([](TetMesh& m) {
                     m.links = {{NodeIndex(0), NodeIndex(1)}, {NodeIndex(0), NodeIndex(1)}};
                   });
                 },
                 "link 1 (0, 1) repeats"},
        Breakage{"OpenSurface",
                 [] { return changed([](TetMesh& m) { m.boundary_triangles.pop_back(); }); },
                 "surface is open"},
        Breakage{"FlippedTriangle",
                 [] {
                   return changed([](TetMesh& m) {
                     std::swap(m.boundary_triangles[2][0], m.boundary_triangles[2][1]);
                   });
                 },
                 "not manifold"},
        Breakage{"TrianglesReordered",
                 [] {
                   return changed([](TetMesh& m) {
                     std::swap(m.boundary_triangles[2], m.boundary_triangles[5]);
                   });
                 },
                 "boundary triangle 2"},
        Breakage{"SurfaceTouchesAlongAnEdge",
                 [] {
                   // Two tets that share one edge only: four triangles meet there.
                   TetMesh m;
                   m.rest_positions = {{0, 0, 0}, {0, 0, 1},  {1, 0, 0},
                                       {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
                   m.tets = {{NodeIndex(0), NodeIndex(2), NodeIndex(3), NodeIndex(1)},
                             {NodeIndex(0), NodeIndex(4), NodeIndex(5), NodeIndex(1)}};
                   m.build_adjacency();
                   return m;
                 },
                 "not manifold"},
        Breakage{"NodeTets",
                 [] { return changed([](TetMesh& m) { m.node_tets.items[5] = TetIndex(0); }); },
                 "node_tets"},
        Breakage{"NodeTetsOffsets",
                 [] { return changed([](TetMesh& m) { m.node_tets.offsets[5] += 1; }); },
                 "node_tets"},
        Breakage{"NodeEdges",
                 [] { return changed([](TetMesh& m) { m.node_edges.items.pop_back(); }); },
                 "node_edges"},
        Breakage{"NodeNeighbours",
                 [] {
                   return changed([](TetMesh& m) {
                     std::swap(m.node_neighbours.items[0], m.node_neighbours.items[1]);
                   });
                 },
                 "node_neighbours of node 0"},
        Breakage{"NodeLinks",
                 [] {
                   auto m = pillow();
                   m.node_links.offsets.pop_back();
                   return m;
                 },
                 "node_links"},
        Breakage{"SurfaceNodes",
                 [] { return changed([](TetMesh& m) { m.surface_nodes.pop_back(); }); },
                 "surface_nodes"},
        Breakage{"SurfaceFlags",
                 [] { return changed([](TetMesh& m) { m.is_surface_node[0] ^= 1; }); },
                 "is_surface_node"},
        Breakage{"UnusedNode",
                 [] { return rebuilt([](TetMesh& m) { m.rest_positions.push_back({}); }); },
                 "node 27 is used by no"}),
    [](const auto& param_info) { return std::string(param_info.param.name); });

TEST(Validate, AcceptsASurfaceHeldByLinks) {
  EXPECT_TRUE(validate(pillow())) << validate(pillow()).error().message;
}

TEST(Quality, CountsTetsByTheirSmallestDihedralAngle) {
  // A corner of a cube has angles of 90 and 54.7 degrees, a regular tet 70.5.
  TetMesh mesh;
  mesh.rest_positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1},
                         {5, 5, 5}, {6, 6, 5}, {6, 5, 6}, {5, 6, 6}};
  mesh.tets = {{NodeIndex(0), NodeIndex(1), NodeIndex(2), NodeIndex(3)},
               {NodeIndex(4), NodeIndex(5), NodeIndex(6), NodeIndex(7)}};
  const auto counts = dihedral_histogram(mesh);
  EXPECT_EQ(counts[5], 1u);
  EXPECT_EQ(counts[7], 1u);
}

}  // namespace
}  // namespace trocar::mesh
