#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/tool/tool.h"
#include "server/organs/catalogue/builtin_organs.h"

namespace trocar::organ {
namespace {

TEST(Lattice, IsChoisByDefault) {
  const Organ organ = catalogue::make_lattice();
  ASSERT_TRUE(validate(organ)) << validate(organ).error().message;
  EXPECT_EQ(organ.mesh.node_count(), 13500u);
  EXPECT_EQ(organ.mesh.links.size(), 29u * 15 * 30 + 30u * 14 * 30 + 30u * 15 * 29);
  EXPECT_EQ(organ.mesh.boundary_triangles.size(), 4u * (29 * 14 + 29 * 29 + 14 * 29));
  EXPECT_EQ(organ.mesh.surface_nodes.size(), 13500u - 28 * 13 * 28);
  EXPECT_EQ(organ.fixed_nodes.size(), 900u);
  for (const NodeIndex node : organ.fixed_nodes)
    EXPECT_NEAR(organ.mesh.rest_positions[node.value].y, -0.07, 1e-12);
  for (const auto& s : springs_of(organ)) EXPECT_DOUBLE_EQ(s.stiffness_n_m, 40.0);
  const double mass =
      std::accumulate(organ.node_masses_kg.begin(), organ.node_masses_kg.end(), 0.0);
  EXPECT_NEAR(mass, 1060 * 0.29 * 0.14 * 0.29, 1e-9);
}

TEST(Lattice, NeighboursAreTheSixNearest) {
  const catalogue::LatticeSize size{5, 4, 6, 0.02};
  const auto organ = catalogue::make_lattice(size);
  ASSERT_TRUE(organ.ok());
  const auto& mesh = organ->mesh;
  for (int k = 0; k < size.nz; ++k)
    for (int j = 0; j < size.ny; ++j)
      for (int i = 0; i < size.nx; ++i) {
        const NodeIndex node = catalogue::lattice_node(size, i, j, k);
        std::vector<NodeIndex> expected;
        if (k > 0) expected.push_back(catalogue::lattice_node(size, i, j, k - 1));
        if (j > 0) expected.push_back(catalogue::lattice_node(size, i, j - 1, k));
        if (i > 0) expected.push_back(catalogue::lattice_node(size, i - 1, j, k));
        if (i + 1 < size.nx) expected.push_back(catalogue::lattice_node(size, i + 1, j, k));
        if (j + 1 < size.ny) expected.push_back(catalogue::lattice_node(size, i, j + 1, k));
        if (k + 1 < size.nz) expected.push_back(catalogue::lattice_node(size, i, j, k + 1));
        EXPECT_TRUE(std::ranges::equal(mesh.node_neighbours[node], expected));
        for (const NodeIndex other : expected)
          EXPECT_NEAR(length(mesh.rest_positions[other.value] - mesh.rest_positions[node.value]),
                      0.02, 1e-12);
      }
}

TEST(Lattice, NormalsPointOutward) {
  const Organ organ = catalogue::make_lattice();
  const auto normals = mesh::surface_normals(organ.mesh);
  for (const NodeIndex node : organ.mesh.surface_nodes) {
    const Vec3d& p = organ.mesh.rest_positions[node.value];
    const Vec3d& n = normals[node.value];
    EXPECT_GT(dot(n, p), 0);
    // Each face's own direction is present.
    if (p.y > 0.0699) {
      EXPECT_GT(n.y, 0.3);
    }
    if (p.x < -0.1449) {
      EXPECT_LT(n.x, -0.3);
    }
  }
}

TEST(Lattice, RefusesSizesOutOfRange) {
  EXPECT_FALSE(catalogue::make_lattice(catalogue::LatticeSize{1, 5, 5, 0.01}).ok());
  EXPECT_FALSE(catalogue::make_lattice(catalogue::LatticeSize{5, 5, 401, 0.001}).ok());
  EXPECT_FALSE(catalogue::make_lattice(catalogue::LatticeSize{5, 5, 5, 0.0}).ok());
  EXPECT_FALSE(catalogue::make_lattice(catalogue::LatticeSize{300, 5, 5, 0.01}).ok());  // 3 m long
}

TEST(Tool, NamesAndLimits) {
  EXPECT_STREQ(name_of(tool::Verb::None), "none");
  EXPECT_STREQ(name_of(tool::Verb::Push), "push");
  EXPECT_STREQ(name_of(tool::Verb::Grasp), "grasp");
  EXPECT_TRUE(tool::is_valid(tool::ToolShape{}));
  EXPECT_TRUE(tool::is_valid({0.0005f, 0.01f, 0.001f}));
  EXPECT_TRUE(tool::is_valid({0.05f, 1.0f, 0.05f}));
  EXPECT_FALSE(tool::is_valid({0.00049f, 0.3f, 0.01f}));
  EXPECT_FALSE(tool::is_valid({0.005f, 1.01f, 0.01f}));
  EXPECT_FALSE(tool::is_valid({0.005f, 0.3f, 0.051f}));
  EXPECT_FALSE(tool::is_valid({std::nanf(""), 0.3f, 0.01f}));
}

}  // namespace
}  // namespace trocar::organ
