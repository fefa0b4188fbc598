#include "server/organs/mesh/conform.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "server/organs/mesh/match_volumes.h"

namespace trocar::mesh {
namespace {

const Box kBallBox{{-1.2, -1.2, -1.2}, {1.2, 1.2, 1.2}};
constexpr double kBallSpacing = 0.2;
// By which a triangle with a circumradius of 0.8 spacings is within the ball of radius 1.
constexpr double kSagitta = 0.64 * kBallSpacing * kBallSpacing / 2;

double to_ball(const Vec3d& p) {
  return length(p) - 1;
}

ConformingMesh conformed(const LabelAt& label_at) {
  const auto ball = stuff_isosurface(to_ball, kBallBox, kBallSpacing);
  EXPECT_TRUE(ball.ok());
  auto result = conform_to_labels(*ball, kBallSpacing, label_at, to_ball);
  EXPECT_TRUE(result.ok()) << (result.ok() ? "" : result.error().message);
  return std::move(*result);
}

void expect_conforming(const ConformingMesh& result, const std::string& what) {
  const Status status = validate(result.mesh);
  ASSERT_TRUE(status) << what << ": " << status.error().message;
  const auto angles = dihedral_range(result.mesh);
  EXPECT_GE(angles.min_deg, kStuffingMinDihedral_deg) << what;
  EXPECT_LE(angles.max_deg, kStuffingMaxDihedral_deg) << what;
  EXPECT_EQ(result.tet_labels.size(), result.mesh.tets.size());
  // The outer surface is the ball's, but for the flatness of its triangles.
  for (const NodeIndex node : result.mesh.surface_nodes) {
    const double off = to_ball(result.mesh.rest_positions[node.value]);
    EXPECT_LE(off, 1e-3) << what;
    EXPECT_GE(off, -kSagitta) << what;
  }
}

double volume_of(const ConformingMesh& result, std::uint16_t label) {
  double volume = 0;
  for (std::size_t t = 0; t < result.mesh.tets.size(); ++t)
    if (result.tet_labels[t] == label) volume += tet_volume(result.mesh, TetIndex(t));
  return volume;
}

Vec3d random_direction(std::mt19937& random) {
  std::uniform_real_distribution<double> in(-1, 1);
  Vec3d n;
  do n = {in(random), in(random), in(random)};
  while (length(n) > 1 || length(n) < 0.1);
  return normalized(n, Vec3d{1, 0, 0});
}

// The law: no tet without a step passes through a plane that it has to follow.
TEST(Conform, FollowsPlanesThroughABall) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> in(-0.7, 0.7);
  for (int i = 0; i < 60; ++i) {
    const Vec3d normal = random_direction(random);
    const double height = in(random);
    const auto result =
        conformed([&](const Vec3d& p) { return std::uint16_t(dot(p, normal) < height ? 1 : 2); });
    const std::string what = "plane " + std::to_string(i);
    expect_conforming(result, what);
    std::size_t passed = 0;
    for (std::size_t t = 0; t < result.mesh.tets.size(); ++t) {
      double least = 1, most = -1;
      for (const NodeIndex node : result.mesh.tets[t]) {
        const double above = dot(result.mesh.rest_positions[node.value], normal) - height;
        least = std::min(least, above), most = std::max(most, above);
      }
      // Nodes of the outer surface are brought back to it after they came onto the plane.
      const double slack = kSagitta;
      if (least < -slack && most > slack) {
        ++passed;
      } else if (most > slack || least < -slack) {
        EXPECT_EQ(result.tet_labels[t], most > slack ? 2 : 1) << what;
      }
    }
    EXPECT_LE(passed, result.steps) << what;
  }
}

TEST(Conform, FollowsBallsInABall) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> in(0.25, 0.6);
  for (int i = 0; i < 40; ++i) {
    const double radius = in(random);
    const Vec3d centre = random_direction(random) * (0.75 - radius);
    const auto result = conformed(
        [&](const Vec3d& p) { return std::uint16_t(length(p - centre) < radius ? 2 : 1); });
    const std::string what = "ball " + std::to_string(i);
    expect_conforming(result, what);
    if (result.steps > 0) continue;
    for (const auto& triangle : interface_of(result.mesh, result.tet_labels, 2))
      for (const NodeIndex node : triangle)
        EXPECT_NEAR(length(result.mesh.rest_positions[node.value] - centre), radius, 1e-6) << what;
  }
}

TEST(Conform, OneLabelLeavesTheMeshAsItWas) {
  const auto ball = stuff_isosurface(to_ball, kBallBox, kBallSpacing);
  const auto result = conformed([](const Vec3d&) { return std::uint16_t{5}; });
  EXPECT_EQ(result.mesh, *ball);
  EXPECT_EQ(result.moved_nodes + result.split_edges + result.steps, 0u);
}

TEST(Conform, SameInputsGiveTheSameMesh) {
  const LabelAt label_at = [](const Vec3d& p) {
    return std::uint16_t(p.x < 0.03 ? 1 : p.y < 0.05 ? 2 : p.z < 0.07 ? 3 : 4);
  };
  const auto one = conformed(label_at), two = conformed(label_at);
  EXPECT_EQ(one.mesh, two.mesh);
  EXPECT_EQ(one.tet_labels, two.tet_labels);
}

// Four labels meet in a point and three along lines.
TEST(Conform, ThreeLabelsMeet) {
  std::mt19937 random(3);
  for (int i = 0; i < 30; ++i) {
    const Vec3d a = random_direction(random), b = random_direction(random),
                c = random_direction(random);
    const auto result = conformed([&](const Vec3d& p) {
      return std::uint16_t(dot(p, a) < 0.1 ? 1 : dot(p, b) < 0.05 ? 2 : dot(p, c) < 0 ? 3 : 4);
    });
    expect_conforming(result, "set " + std::to_string(i));
    // Steps are along lines at most, of which a ball of ten spacings has less than 60 spacings.
    EXPECT_LT(result.steps, 12u * 60) << i;
  }
}

TEST(MatchVolumes, GivesABallItsVolume) {
  const double radius = 0.45, exact = 4 * std::numbers::pi / 3 * radius * radius * radius;
  auto result =
      conformed([&](const Vec3d& p) { return std::uint16_t(length(p) < radius ? 2 : 1); });
  const double before = volume_of(result, 2), whole = total_volume(result.mesh);
  EXPECT_LT(before, exact);  // nodes are on the ball, faces within
  match_volumes(result.mesh, result.tet_labels, {{2, exact}}, 0.15 * kBallSpacing,
                conforming_bound());
  EXPECT_NEAR(volume_of(result, 2), exact, 0.01 * exact);
  EXPECT_NEAR(total_volume(result.mesh), whole, 1e-9);
  expect_conforming(result, "matched");
  // The limit holds.
  match_volumes(result.mesh, result.tet_labels, {{2, 8 * exact}}, 0.15 * kBallSpacing,
                conforming_bound());
  EXPECT_LT(volume_of(result, 2), 1.6 * exact);
  expect_conforming(result, "limited");
}

}  // namespace
}  // namespace trocar::mesh
