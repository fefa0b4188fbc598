#include "server/organs/surface/closed_surface.h"

#include <gtest/gtest.h>

#include "server/organs/surface/intersection.h"
#include "tests/surface/shapes.h"

namespace trocar::surface {
namespace {

using testing::add_box;
using testing::add_triangle;
using testing::ball;

Result<ClosedSurface> check(const RawSurface& raw) {
  return check_surface(raw, mesh::Unit::Metre, "a.stl");
}
RawSurface box() {
  RawSurface raw;
  add_box(raw, {1, 2, 3}, 0.1);
  return raw;
}
void expect_error(const RawSurface& raw, const char* part) {
  const auto result = check(raw);
  ASSERT_FALSE(result.ok()) << part;
  EXPECT_NE(result.error().message.find(part), std::string::npos) << result.error().message;
  EXPECT_EQ(result.error().message.find('\n'), std::string::npos);
}
void expect_warning(const RawSurface& raw, const char* part) {
  const auto result = check(raw);
  ASSERT_TRUE(result.ok()) << result.error().message;
  ASSERT_EQ(result->warnings.size(), 1u);
  EXPECT_NE(result->warnings[0].find(part), std::string::npos) << result->warnings[0];
  EXPECT_NEAR(result->volume_m3, 1e-3, 1e-15);
}

TEST(ClosedSurface, KeepsASoundBoxAndCentresIt) {
  const auto result = check(box());
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_TRUE(result->warnings.empty());
  EXPECT_NEAR(length(result->offset_m - Vec3d{1.05, 2.05, 3.05}), 0, 1e-15);
  EXPECT_NEAR(result->volume_m3, 1e-3, 1e-15);
  EXPECT_NEAR(result->area_m2, 0.06, 1e-15);
  EXPECT_EQ(result->cavities, 0u);
}

TEST(ClosedSurface, RepairsWhatCanOnlyBeMeantOneWay) {
  auto one = box();
  std::swap(one.triangles[4][0], one.triangles[4][1]);
  expect_warning(one, "turned 1 of 12 triangles");
  RawSurface inward;
  add_box(inward, {}, 0.1, true);
  expect_warning(inward, "turned 12 of 12 triangles");
  auto twice = box();
  twice.triangles.push_back(twice.triangles[3]);
  twice.face_numbers.push_back(13);
  expect_warning(twice, "dropped 1 triangles that were listed twice");
  auto unused = box();
  unused.positions.push_back({5, 5, 5});
  expect_warning(unused, "dropped 1 vertices that no face uses");
  auto soup = box();
  soup.positions.push_back(soup.positions[7]);
  soup.triangles[11][1] = NodeIndex(8);
  expect_warning(soup, "welded 1 vertices");
  auto crumb = box();
  add_box(crumb, {1.5, 2, 3}, 0.001);
  expect_warning(crumb, "dropped 1 separate bodies");
}

TEST(ClosedSurface, RefusesAndNamesThePlace) {
  auto open = box();
  open.triangles.pop_back();
  open.face_numbers.pop_back();
  expect_error(open, "is not closed, 3 edges have a face on one side only");
  auto fin = box();
  fin.positions.push_back({2, 2, 2});
  add_triangle(fin, {0, 1, 8});
  expect_error(fin, "edge from vertex 1 to 2 at (1.05, 2, 3) belongs to 3 faces (2, 5, 13)");
  auto two = box();
  add_box(two, {1.5, 2, 3}, 0.1);
  expect_error(two, "is 2 separate bodies");
  auto through = box();
  add_box(through, {1.05, 2.05, 3.05}, 0.1);
  expect_error(through, "pairs of faces intersect");
  RawSurface wide;
  add_box(wide, {}, 100);
  expect_error(wide, "is 100 m wide, larger than 2 m: if the file is in millimetres");
  RawSurface centimetres, either;
  add_box(centimetres, {}, 12);
  expect_error(centimetres, "is 12 m wide, larger than 2 m: if the file is in centimetres");
  add_box(either, {}, 30);
  expect_error(either, "is 30 m wide, larger than 2 m: if the file is in millimetres or cent");
  RawSurface flat = box();
  for (Vec3d& p : flat.positions) p.z = 3;
  expect_error(flat, "");
  expect_error({}, "has no triangles");
}

TEST(ClosedSurface, ShellsInsideAreCavities) {
  // The inner one faces either way: what it can only mean is a cavity.
  for (const bool is_mirrored : {false, true}) {
    auto hollow = box();
    add_box(hollow, {1.02, 2.02, 3.02}, 0.05, is_mirrored);
    const auto result = check(hollow);
    ASSERT_TRUE(result.ok()) << result.error().message;
    EXPECT_EQ(result->cavities, 1u);
    EXPECT_NEAR(result->volume_m3, 1e-3 - 1.25e-4, 1e-15);
    EXPECT_EQ(result->warnings.empty(), is_mirrored);
    if (is_mirrored) continue;
    EXPECT_NE(result->warnings[0].find("1 shells of 125 ml inside another face outwards"),
              std::string::npos)
        << result->warnings[0];
  }
}

TEST(Intersection, TellsTouchingNeighboursFromCrossingTriangles) {
  const std::vector<Vec3d> p = {{0, 0, 0},   {1, 0, 0},      {0, 1, 0},   {0, 0, 1}, {1, 1, 0},
                                {-1, -1, 0}, {.2, .2, -1.0}, {.3, .3, 1}, {9, 9, 0}, {.5, .25, 0}};
  const auto t = [](std::size_t a, std::size_t b, std::size_t c) {
    return mesh::Triangle{NodeIndex(a), NodeIndex(b), NodeIndex(c)};
  };
  EXPECT_FALSE(intersect(p, t(0, 1, 2), t(1, 4, 2)));  // side by side in a plane
  EXPECT_FALSE(intersect(p, t(0, 1, 2), t(0, 1, 3)));  // along an edge
  EXPECT_FALSE(intersect(p, t(0, 1, 2), t(0, 3, 5)));  // at a corner
  EXPECT_TRUE(intersect(p, t(0, 1, 2), t(1, 0, 9)));   // folded back onto it
  EXPECT_TRUE(intersect(p, t(0, 1, 2), t(6, 7, 8)));   // pierced
  EXPECT_TRUE(intersect(p, t(0, 1, 2), t(0, 6, 7)));   // pierced, with a common corner
  EXPECT_FALSE(intersect(p, t(1, 4, 2), t(6, 5, 3)));  // apart
}

TEST(Intersection, ABallPassesNowhereThroughItself) {
  const auto result = check(ball(0.1, 4));
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_EQ(result->triangles.size(), 2048u);
}

}  // namespace
}  // namespace trocar::surface
