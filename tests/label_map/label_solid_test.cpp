#include "server/organs/label_map/label_solid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "server/organs/label_map/label_mesh.h"
#include "server/organs/label_map/nifti_reader.h"
#include "tests/label_map/nifti_sample.h"

namespace trocar::label_map {
namespace {

using testing::nifti;

// A ball of label 1, 40 mm across, with one of label 2 in it, off its centre.
LabelMap ball_in_ball() {
  const auto inside = [](double x, double y, double z, double radius) {
    return x * x + y * y + z * z < radius * radius;
  };
  auto map = parse_nifti(nifti({50, 50, 50}, 1,
                               [&](int i, int j, int k) {
                                 const double x = i - 24.5, y = j - 24.5, z = k - 24.5;
                                 return inside(x - 6, y, z, 9) ? 2 : inside(x, y, z, 20) ? 1 : 0;
                               }),
                         std::nullopt, "a.nii");
  TROCAR_ASSERT(map.ok());
  return std::move(*map);
}

TEST(LabelSolid, KnowsVolumesAndDistances) {
  const auto solid = LabelSolid::make(ball_in_ball(), {}, "a.nii");
  ASSERT_TRUE(solid.ok()) << solid.error().message;
  EXPECT_EQ(solid->labels(), (std::vector<std::uint16_t>{1, 2}));
  // Voxels of 1 mm count a ball of 20 mm to about a percent.
  const double volume = 4.0 / 3 * std::numbers::pi * 8e-6;
  EXPECT_NEAR(solid->volume_m3(), volume, 0.01 * volume);
  // The distance is that to the ball, to the step of a voxel.
  const Vec3d centre{-0.0345, 0.0245, 0.0245};
  for (const double r : {0.016, 0.019, 0.02, 0.021, 0.024})
    for (const Vec3d& d : {Vec3d{1, 0, 0}, Vec3d{0, -1, 0}, Vec3d{0.6, 0, 0.8}})
      EXPECT_NEAR(solid->distance(centre + d * r), r - 0.02, 0.001) << r;
  EXPECT_EQ(solid->label_at(centre), 2);
  EXPECT_EQ(solid->label_at(centre + Vec3d{0.01, 0, 0}), 1);
  EXPECT_EQ(solid->label_at(centre + Vec3d{0.03, 0, 0}), 0);
}

TEST(LabelSolid, ChoosesLabelsAndOneBody) {
  const auto inner = LabelSolid::make(ball_in_ball(), {2}, "a.nii");
  ASSERT_TRUE(inner.ok()) << inner.error().message;
  EXPECT_EQ(inner->labels(), std::vector<std::uint16_t>{2});
  const auto missing = LabelSolid::make(ball_in_ball(), {7}, "a.nii");
  ASSERT_FALSE(missing.ok());
  EXPECT_NE(missing.error().message.find("no voxel has label 7"), std::string::npos);

  auto crumb = ball_in_ball();
  crumb.labels[crumb.index(1, 1, 1)] = 1;
  const auto kept = LabelSolid::make(crumb, {}, "a.nii");
  ASSERT_TRUE(kept.ok()) << kept.error().message;
  ASSERT_EQ(kept->warnings().size(), 1u);
  EXPECT_NE(kept->warnings()[0].find("dropped 1 separate bodies"), std::string::npos);
  EXPECT_TRUE(kept->warnings()[0].ends_with(" of the volume, 0.001 ml")) << kept->warnings()[0];
  auto stone = crumb;
  stone.labels[stone.index(1, 1, 1)] = 9;
  const auto without = LabelSolid::make(stone, {}, "a.nii");
  ASSERT_TRUE(without.ok()) << without.error().message;
  EXPECT_TRUE(without->warnings()[0].ends_with("and with them all of these labels: 9"))
      << without->warnings()[0];
  for (int k = 0; k < 50; ++k)
    for (int j = 0; j < 50; ++j)
      for (int i = 0; i < 2; ++i) crumb.labels[crumb.index(i, j, k)] = 1;
  const auto two = LabelSolid::make(crumb, {}, "a.nii");
  ASSERT_FALSE(two.ok());
  EXPECT_NE(two.error().message.find("is 2 separate bodies"), std::string::npos);
  auto nothing = ball_in_ball();
  std::fill(nothing.labels.begin(), nothing.labels.end(), std::uint16_t{0});
  EXPECT_FALSE(LabelSolid::make(nothing, {}, "a.nii").ok());
}

TEST(LabelSolid, OneVoxelThickIsRefusedAtOnce) {
  const auto error_of = [](const std::function<bool(int, int, int)>& is_in) {
    const auto map = parse_nifti(
        nifti({20, 20, 20}, 3, [&](int i, int j, int k) { return is_in(i, j, k) ? 1 : 0; }),
        std::nullopt, "a.nii");
    TROCAR_ASSERT(map.ok());
    const auto solid = LabelSolid::make(*map, {}, "a.nii");
    return solid.ok() ? "accepted" : solid.error().message;
  };
  const std::string rest =
      " 3 mm thick: it has no inside, whatever the number of nodes; take a map of thinner voxels";
  EXPECT_EQ(error_of([](int, int j, int) { return j == 4; }), "a.nii: is one slice," + rest);
  EXPECT_EQ(error_of([](int i, int j, int k) { return (i == 4) + (j == 4) + (k == 4) > 1; }),
            "a.nii: is hardly anywhere thicker than a voxel, at most" + rest);
  EXPECT_EQ(error_of([](int, int j, int) { return j == 4 || j == 5; }), "accepted");
}

// The request is a volume within 1 % of the map's, and regions by label.
TEST(LabelMesh, HasTheVolumeOfTheMapAndItsRegions) {
  const auto solid = LabelSolid::make(ball_in_ball(), {}, "a.nii");
  ASSERT_TRUE(solid.ok()) << solid.error().message;
  const auto result = mesh_labels(*solid, 2000, {{2, "tumour"}}, "a.nii");
  ASSERT_TRUE(result.ok()) << result.error().message;
  const auto& [imported, notes] = *result;
  EXPECT_TRUE(mesh::validate(imported.mesh));
  EXPECT_NEAR(mesh::total_volume(imported.mesh), solid->volume_m3(), 0.01 * solid->volume_m3());
  ASSERT_EQ(imported.regions.size(), 2u);
  EXPECT_EQ(imported.regions[0].name, "label 1");
  EXPECT_EQ(imported.regions[1].name, "tumour");
  // Nodes of the inner ball are within it, but for a cell of the mesh.
  for (const NodeIndex node : imported.regions[1].nodes) {
    const Vec3d p = imported.mesh.rest_positions[node.value] + imported.offset_m;
    EXPECT_LT(length(p - Vec3d{-0.0405, 0.0245, 0.0245}), 0.009 + 0.005);
  }
}

// Nothing is a worse map than noise: each voxel has a label of its own.
TEST(LabelMesh, NoiseKeepsTheBoundsOfShape) {
  std::mt19937 random(1);
  for (const unsigned labels : {2u, 5u}) {
    auto map = parse_nifti(
        nifti({16, 16, 16}, 3, [&](int, int, int) { return int(1 + random() % labels); }),
        std::nullopt, "a.nii");
    ASSERT_TRUE(map.ok());
    const auto solid = LabelSolid::make(std::move(*map), {}, "a.nii");
    ASSERT_TRUE(solid.ok()) << solid.error().message;
    const auto result = mesh_labels(*solid, 4000, {}, "a.nii");
    ASSERT_TRUE(result.ok()) << result.error().message;
    const auto& mesh = result->imported.mesh;
    EXPECT_TRUE(mesh::validate(mesh)) << labels;
    const auto angles = mesh::dihedral_range(mesh);
    EXPECT_GE(angles.min_deg, mesh::kStuffingMinDihedral_deg) << labels;
    EXPECT_LE(angles.max_deg, mesh::kStuffingMaxDihedral_deg) << labels;
    EXPECT_NEAR(mesh::total_volume(mesh), solid->volume_m3(), 0.01 * solid->volume_m3()) << labels;
  }
}

}  // namespace
}  // namespace trocar::label_map
