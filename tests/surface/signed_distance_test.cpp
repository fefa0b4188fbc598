#include "server/organs/surface/signed_distance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/organs/mesh/fill_field.h"
#include "tests/surface/shapes.h"

namespace trocar::surface {
namespace {

using testing::add_box;
using testing::ball;

ClosedSurface checked(RawSurface raw) {
  auto result = check_surface(std::move(raw), mesh::Unit::Metre, "a");
  TROCAR_ASSERT(result.ok());
  return std::move(*result);
}

TEST(SignedDistance, OfABoxIsThatOfTheFormula) {
  RawSurface raw;
  add_box(raw, {-0.5, -0.5, -0.5}, 1);
  const auto box = checked(std::move(raw));
  const SignedDistance distance(box);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(-1, 1);
  for (int i = 0; i < 2000; ++i) {
    const Vec3d p{place(random), place(random), place(random)};
    const Vec3d q{std::abs(p.x) - 0.5, std::abs(p.y) - 0.5, std::abs(p.z) - 0.5};
    const Vec3d out{std::max(q.x, 0.0), std::max(q.y, 0.0), std::max(q.z, 0.0)};
    const double expected = length(out) + std::min(std::max({q.x, q.y, q.z}), 0.0);
    EXPECT_NEAR(distance(p), expected, 1e-14);
  }
}

// The request is a volume within 1 %; angles are those that stuffing promises.
TEST(FillField, MeetsVolumeAndNumberOfNodes) {
  for (const int nodes : {200, 2000}) {
    const auto solid = checked(ball(0.05, 4));
    const SignedDistance distance(solid);
    const Vec3d half{0.05, 0.05, 0.05};
    const auto filled = mesh::fill_field([&](const Vec3d& p) { return distance(p); }, {-half, half},
                                         solid.volume_m3, solid.area_m2, nodes);
    ASSERT_TRUE(filled.ok()) << filled.error().message;
    EXPECT_TRUE(mesh::validate(filled->mesh));
    EXPECT_NEAR(static_cast<double>(filled->mesh.node_count()), nodes, 0.15 * nodes);
    EXPECT_NEAR(mesh::total_volume(filled->mesh), solid.volume_m3, 0.01 * solid.volume_m3);
    const auto angles = mesh::dihedral_range(filled->mesh);
    EXPECT_GE(angles.min_deg, mesh::kStuffingMinDihedral_deg);
    EXPECT_LE(angles.max_deg, mesh::kStuffingMaxDihedral_deg);
  }
}

TEST(FillField, SaysHowManyNodesAThinWallNeeds) {
  auto raw = ball(0.05, 4);
  const auto inner = ball(0.049, 4);
  const auto first = raw.positions.size();
  raw.positions.insert(raw.positions.end(), inner.positions.begin(), inner.positions.end());
  for (const auto& [a, b, c] : inner.triangles)
    testing::add_triangle(raw, {first + a.value, first + c.value, first + b.value});
  const auto solid = checked(std::move(raw));
  const SignedDistance distance(solid);
  const Vec3d half{0.05, 0.05, 0.05};
  const auto filled = mesh::fill_field([&](const Vec3d& p) { return distance(p); }, {-half, half},
                                       solid.volume_m3, solid.area_m2, 500);
  ASSERT_FALSE(filled.ok());
  EXPECT_NE(filled.error().message.find("parts are thinner than the spacing"), std::string::npos)
      << filled.error().message;
}

}  // namespace
}  // namespace trocar::surface
