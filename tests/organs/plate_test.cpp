#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/mesh/pieces.h"

namespace trocar::organ {
namespace {

TEST(Plate, HasNakaosCounts) {
  const Organ organ = catalogue::make_plate();
  ASSERT_TRUE(validate(organ)) << validate(organ).error().message;
  const auto& mesh = organ.mesh;
  const auto near = [](std::size_t ours, double printed) {
    EXPECT_NEAR(static_cast<double>(ours), printed, 0.01 * printed);
  };
  near(mesh.node_count(), 1274);
  near(mesh.edges.size(), 6160);
  near(mesh.tets.size(), 3647);
  near(mesh.boundary_triangles.size(), 2500);
  // One closed solid without holes.
  EXPECT_EQ(mesh.node_count() + mesh.tets.size() + mesh.boundary_triangles.size() / 2,
            mesh.edges.size() + 1);
  EXPECT_EQ(mesh.surface_nodes.size(), mesh.boundary_triangles.size() / 2 + 2);
  EXPECT_EQ(mesh::find_pieces(mesh).count, 1u);
}

TEST(Plate, HasNakaosSizeAndMaterial) {
  const Organ organ = catalogue::make_plate();
  Vec3d high{};
  for (const Vec3d& p : organ.mesh.rest_positions)
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  EXPECT_DOUBLE_EQ(high.x, 0.08);
  EXPECT_DOUBLE_EQ(high.y, 0.002);
  EXPECT_DOUBLE_EQ(high.z, 0.08);
  EXPECT_NEAR(mesh::total_volume(organ.mesh), 0.16 * 0.16 * 0.004, 1e-12);
  const double mass =
      std::accumulate(organ.node_masses_kg.begin(), organ.node_masses_kg.end(), 0.0);
  EXPECT_NEAR(mass, 900 * 0.16 * 0.16 * 0.004, 1e-9);
  for (const auto& s : springs_of(organ)) EXPECT_DOUBLE_EQ(s.stiffness_n_m, 100);
  EXPECT_DOUBLE_EQ(organ.material.edge_damping_time_s * organ.material.spring_stiffness_n_m, 0.05);
  const auto angles = mesh::dihedral_range(organ.mesh);
  EXPECT_GT(angles.min_deg, 30);
  EXPECT_LT(angles.max_deg, 140);
}

TEST(Plate, HasItsYoungsModulusFromItsSprings) {
  const Organ organ = catalogue::make_plate();
  double k_l_squared = 0;
  for (const auto& [a, b] : organ.mesh.edges)
    k_l_squared += 100 * length_squared(organ.mesh.rest_positions[b.value] -
                                        organ.mesh.rest_positions[a.value]);
  const double modulus = k_l_squared / 6 / mesh::total_volume(organ.mesh);
  EXPECT_NEAR(organ.material.young_modulus_pa, modulus, 0.01 * modulus);
}

TEST(Plate, IsHeldAllAroundTheRimAndNowhereElse) {
  const Organ organ = catalogue::make_plate();
  std::size_t on_rim = 0;
  for (const Vec3d& p : organ.mesh.rest_positions)
    on_rim += std::abs(p.x) > 0.0799 || std::abs(p.z) > 0.0799;
  EXPECT_EQ(on_rim, 2u * 4 * 24);
  EXPECT_EQ(organ.fixed_nodes.size(), on_rim);
  for (const NodeIndex node : organ.fixed_nodes) {
    const Vec3d& p = organ.mesh.rest_positions[node.value];
    EXPECT_TRUE(std::abs(p.x) > 0.0799 || std::abs(p.z) > 0.0799);
  }
}

// Mirrored cells: neither diagonal of the cells is preferred.
TEST(Plate, IsAsStiffAlongOneDiagonalAsAlongTheOther) {
  const Organ organ = catalogue::make_plate();
  double rising = 0, falling = 0;
  for (const auto& [a, b] : organ.mesh.edges) {
    const Vec3d d = organ.mesh.rest_positions[b.value] - organ.mesh.rest_positions[a.value];
    (d.x * d.z > 0 ? rising : falling) += std::abs(d.x * d.z);
  }
  EXPECT_NEAR(rising, falling, 0.01 * rising);
}

TEST(Plate, MeshIsTheSameOnEveryMachine) {
  const auto organ = catalogue::load_organ("plate");
  ASSERT_TRUE(organ.ok());
  EXPECT_EQ(organ_hash(*organ), 0x8b46d64fd09bb782ull) << std::hex << organ_hash(*organ);
}

}  // namespace
}  // namespace trocar::organ
