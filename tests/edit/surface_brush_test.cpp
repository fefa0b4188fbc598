// The brush takes what lies around a place along the surface, and below it.

#include "server/organs/edit/surface_brush.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/organs/catalogue/builtin_organs.h"

namespace trocar::edit {
namespace {

// The upper face of the plate is at y = 2 mm; its nodes are 6.67 mm apart.
SurfacePlace middle_of_upper_face(const mesh::TetMesh& mesh) {
  SurfacePlace nearest;
  double least = 1;
  for (std::size_t t = 0; t < mesh.boundary_triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.boundary_triangles[t];
    const auto& p = mesh.rest_positions;
    const Vec3d centre = (p[a.value] + p[b.value] + p[c.value]) / 3.0;
    if (centre.y > 0.0019 && length(centre - Vec3d{0, 0.002, 0}) < least) {
      least = length(centre - Vec3d{0, 0.002, 0});
      nearest = {static_cast<std::uint32_t>(t), centre};
    }
  }
  return nearest;
}

TEST(SurfaceBrush, LeavesTheFarSideOfAThinWall) {
  const auto organ = catalogue::make_plate();
  const SurfaceBrush brush(organ.mesh);
  const auto place = middle_of_upper_face(organ.mesh);
  const auto nodes = brush.nodes_at(place, 0.03);
  ASSERT_GT(nodes.size(), 20u);
  EXPECT_TRUE(std::ranges::is_sorted(nodes));
  std::size_t expected = 0;  // of the upper face, in the ball
  for (std::size_t i = 0; i < organ.mesh.node_count(); ++i) {
    const Vec3d& p = organ.mesh.rest_positions[i];
    expected += p.y > 0.0019 && length(p - place.position_m) <= 0.03;
  }
  EXPECT_EQ(nodes.size(), expected);
  for (const NodeIndex node : nodes)
    EXPECT_GT(organ.mesh.rest_positions[node.value].y, 0.0019) << node.value;
}

TEST(SurfaceBrush, TakesANodeHoweverSmallItIs) {
  const auto organ = catalogue::make_plate();
  const SurfaceBrush brush(organ.mesh);
  const auto place = middle_of_upper_face(organ.mesh);
  const auto nodes = brush.nodes_at(place, 1e-6);
  ASSERT_EQ(nodes.size(), 1u);
  const auto& corners = organ.mesh.boundary_triangles[place.triangle];
  EXPECT_NE(std::ranges::find(corners, nodes[0]), corners.end());
  EXPECT_TRUE(brush.nodes_at({0xffffffff, {}}, 0.01).empty());
}

TEST(SurfaceBrush, GoesAsDeepAsItIsTold) {
  const auto organ = catalogue::make_liver(2000);
  ASSERT_TRUE(organ.ok());
  const auto& mesh = organ->mesh;
  const SurfaceBrush brush(mesh);
  const auto& [a, b, c] = mesh.boundary_triangles[0];
  const auto& p = mesh.rest_positions;
  const SurfacePlace place{0, (p[a.value] + p[b.value] + p[c.value]) / 3.0};
  const auto flat = brush.nodes_below(place, 0.03, 0);
  const auto deep = brush.nodes_below(place, 0.03, 0.03);
  const auto deeper = brush.nodes_below(place, 0.03, 0.06);
  EXPECT_TRUE(std::ranges::includes(deep, brush.nodes_at(place, 0.03)));
  EXPECT_TRUE(std::ranges::includes(deep, flat));
  EXPECT_TRUE(std::ranges::includes(deeper, deep));
  EXPECT_GT(deep.size(), flat.size());
  for (const NodeIndex node : deeper)
    EXPECT_LE(length(p[node.value] - place.position_m), std::sqrt(0.03 * 0.03 + 0.06 * 0.06));
}

}  // namespace
}  // namespace trocar::edit
