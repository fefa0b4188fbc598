#include "common/lesson/wound.h"

#include <gtest/gtest.h>

#include "tests/lesson/boxes.h"

namespace trocar::lesson {
namespace {

constexpr double kQuantum = 32e-6;

TEST(Wound, FreePieceHasTheVolumeAndMarginOfItsBox) {
  wire::SurfaceLayout layout;
  add_box(layout, {-0.05, -0.05, -0.05}, {0.05, 0.05, 0}, false, true);
  add_box(layout, {-0.02, -0.01, 0.01}, {0.02, 0.01, 0.04}, true, false);
  const Structure lump{
      .name = "lump", .from_m = {0, 0, 0.025}, .to_m = {0, 0, 0.025}, .radius_m = 0.006};
  const auto specimen = find_specimen(layout, lump);
  ASSERT_TRUE(specimen);
  EXPECT_NEAR(specimen->volume_m3, 0.04 * 0.02 * 0.03, 1e-7);
  // The wound's corners are the nearest that is known of it: of the face at z = 0.04.
  const double corner = std::sqrt(0.02 * 0.02 + 0.01 * 0.01 + 0.015 * 0.015);
  EXPECT_NEAR(specimen->margin_m, corner - 0.006, 2 * kQuantum);
}

TEST(Wound, FixedTissueIsNoSpecimenNorIsAPieceBesideTheStructure) {
  wire::SurfaceLayout layout;
  add_box(layout, {-0.05, -0.05, -0.05}, {0.05, 0.05, 0}, false, true);
  add_box(layout, {-0.02, -0.01, 0.01}, {0.02, 0.01, 0.04}, true, false);
  const Structure in_fixed{.name = "a", .from_m = {0, 0, -0.02}, .to_m = {0, 0, -0.02}};
  const Structure outside{.name = "b", .from_m = {0, 0.02, 0.02}, .to_m = {0, 0.02, 0.02}};
  EXPECT_FALSE(find_specimen(layout, in_fixed));
  EXPECT_FALSE(find_specimen(layout, outside));
}

TEST(Wound, AreaWithinAStructure) {
  wire::SurfaceLayout layout;
  add_wound(layout, {0, 0, 0}, {0.002, 0, 0}, {0, 0.002, 0});
  add_wound(layout, {0.1, 0, 0}, {0.102, 0, 0}, {0.1, 0.002, 0});
  const Structure tube{.name = "t", .from_m = {0, -0.1, 0}, .to_m = {0, 0.1, 0}, .radius_m = 0.005};
  EXPECT_NEAR(wound_within_m2(layout, tube), 2e-6, 1e-7);
}

// A strip of wound from the surface at y = 0.05 down to `depth`, along x from 0 to `end`, shifted
// aside by z.
wire::SurfaceLayout strip(double end, double depth, double z) {
  wire::SurfaceLayout layout;
  for (double x = 0; x < end - 1e-9; x += 0.002) {
    const double next = std::min(x + 0.002, end), top = 0.05, bottom = 0.05 - depth;
    add_wound(layout, {x, top, z}, {next, top, z}, {x, bottom, z});
    add_wound(layout, {next, top, z}, {next, bottom, z}, {x, bottom, z});
  }
  return layout;
}

const std::vector<Vec3d> kLine{{0, 0.05, 0}, {0.04, 0.05, 0}};

TEST(Incision, CoversWhatIsDeepEnough) {
  EXPECT_NEAR(measure_incision(strip(0.04, 0.006, 0), kLine, 0.005, 0.005).covered, 1, 1e-9);
  EXPECT_NEAR(measure_incision(strip(0.04, 0.004, 0), kLine, 0.005, 0.005).covered, 0, 1e-9);
  EXPECT_NEAR(measure_incision(strip(0.02, 0.006, 0), kLine, 0.005, 0.005).covered, 0.5, 0.06);
}

TEST(Incision, MeasuresHowFarItIsBesideTheLine) {
  const auto beside = measure_incision(strip(0.04, 0.006, 0.002), kLine, 0.005, 0.005);
  EXPECT_NEAR(beside.error_m, 0.002, 1e-4);
  EXPECT_NEAR(beside.covered, 1, 1e-9);
  const auto stray = measure_incision(strip(0.04, 0.006, 0.02), kLine, 0.005, 0.005);
  EXPECT_EQ(stray.covered, 0);
  EXPECT_NEAR(stray.stray_m2, 0.04 * 0.006, 1e-6);
}

TEST(Structure, DistanceOfBallAndTube) {
  const Structure ball{.name = "b", .from_m = {1, 0, 0}, .to_m = {1, 0, 0}, .radius_m = 0.1};
  EXPECT_NEAR(ball.distance_m({1, 0.3, 0}), 0.2, 1e-12);
  EXPECT_NEAR(ball.distance_m({1, 0, 0}), -0.1, 1e-12);
  const Structure tube{.name = "t", .from_m = {0, 0, 0}, .to_m = {1, 0, 0}, .radius_m = 0.1};
  EXPECT_NEAR(tube.distance_m({0.5, 0, 0.4}), 0.3, 1e-12);
  EXPECT_NEAR(tube.distance_m({2, 0, 0}), 0.9, 1e-12);
}

}  // namespace
}  // namespace trocar::lesson
