#include "server/organs/dicom/slices.h"

#include <gtest/gtest.h>

namespace trocar::dicom {
namespace {

const Vec3d kRight{1, 0, 0}, kDown{0, 1, 0};

std::string error_of(const std::vector<Vec3d>& places, std::optional<double> spacing,
                     bool may_miss) {
  const auto grid = arrange_slices(places, kRight, kDown, spacing, may_miss);
  return grid.ok() ? "accepted" : grid.error().message;
}

TEST(Slices, AreOrderedByTheirPlaceAndNotByTheirTurn) {
  const auto grid =
      arrange_slices({{3, 4, 9}, {3, 4, 5}, {3, 4, 7}, {3, 4, 5}}, kRight, kDown, {}, false);
  ASSERT_TRUE(grid.ok()) << grid.error().message;
  EXPECT_EQ(grid->count, 3);
  EXPECT_EQ(grid->slice_of_places, (std::vector{2, 0, 1, 0}));
  EXPECT_NEAR(length(grid->origin - Vec3d{3, 4, 5}), 0, 1e-12);
  EXPECT_NEAR(length(grid->step - Vec3d{0, 0, 2}), 0, 1e-12);
}

TEST(Slices, PlacesOfFewDigitsMakeOneStep) {
  std::vector<Vec3d> places;
  for (int i = 0; i < 100; ++i) places.push_back({0, 0, std::round(70.0 * i) / 100});
  const auto grid = arrange_slices(places, kRight, kDown, {}, false);
  ASSERT_TRUE(grid.ok()) << grid.error().message;
  EXPECT_EQ(grid->count, 100);
  EXPECT_NEAR(grid->step.z, 0.7, 1e-4);
}

TEST(Slices, EmptyOnesAreLeftOutOnlyWhereTheyMayBe) {
  EXPECT_EQ(error_of({{0, 0, 0}, {0, 0, 2}, {0, 0, 6}}, {}, false),
            "a slice is missing between 2.00 and 6.00 mm");
  const auto grid = arrange_slices({{0, 0, 0}, {0, 0, 4}, {0, 0, 6}}, kRight, kDown, {}, true);
  ASSERT_TRUE(grid.ok()) << grid.error().message;
  EXPECT_EQ(grid->slice_of_places, (std::vector{0, 2, 3}));
  // The file's spacing tells what two slices far apart do not.
  const auto told = arrange_slices({{0, 0, 0}, {0, 0, 6}}, kRight, kDown, 2.0, true);
  ASSERT_TRUE(told.ok()) << told.error().message;
  EXPECT_EQ(told->count, 4);
}

TEST(Slices, WhatFormsNoGridIsRefused) {
  EXPECT_EQ(error_of({}, {}, false), "it has no slice");
  EXPECT_EQ(error_of({{0, 0, 0}}, {}, false),
            "it has one slice, and neither SpacingBetweenSlices nor SliceThickness");
  EXPECT_EQ(error_of({{0, 0, 0}, {0, 0, 1}, {0, 0, 2.4}}, {}, true),
            "its slices are not equally far apart, at 1.000 mm");
  EXPECT_EQ(error_of({{0, 0, 0}, {0.5, 0, 1}}, {}, true),
            "its slices are not straight above one another: resample it at right angles");
  EXPECT_EQ(error_of({{0, 0, 0}, {0, 0, NAN}}, {}, true), "ImagePositionPatient is not finite");
  const auto flat = arrange_slices({{0, 0, 0}}, kRight, kRight, 1.0, true);
  ASSERT_FALSE(flat.ok());
  // Memory follows the slices that are there.
  EXPECT_EQ(error_of({{0, 0, 0}, {0, 0, 0.01}, {0, 0, 100}}, {}, true),
            "its 3 slices are spread over 10001 positions: most of them are missing");
}

}  // namespace
}  // namespace trocar::dicom
