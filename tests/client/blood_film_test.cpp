#include "client/shape/blood_film.h"

#include <gtest/gtest.h>

#include <cmath>

namespace trocar::shape {
namespace {

constexpr float kLevel = 20e-6f;

// Two triangles of a square, one of them dry.
SmoothSurface square() {
  SmoothSurface surface;
  const std::vector<TriangleCorners> triangles{{0, 1, 2}, {0, 2, 3}};
  surface.build(4, triangles, {}, 1000);
  const std::vector<Vec3f> places{{0, 0, 0}, {0.01f, 0, 0}, {0.01f, 0.01f, 0}, {0, 0.01f, 0}};
  surface.update(places);
  return surface;
}

TEST(BloodFilm, HidesByTheLawOfBeerAndLambert) {
  EXPECT_EQ(cover_of(0), 0);
  // Each further depth of the same size hides the same share of what is still seen.
  const float once = 1 - cover_of(50e-6f);
  EXPECT_NEAR(1 - cover_of(150e-6f), once * once * once, 1e-6);
  EXPECT_NEAR(1 - cover_of(kCoveringMetres), std::exp(-1.0f), 1e-6);
}

TEST(BloodFilm, CoversWhatIsBetweenVerticesByHalves) {
  const SmoothSurface surface = square();
  ASSERT_GT(surface.vertex_count(), surface.coarse_vertex_count());
  std::vector<float> covers;
  cover_with_blood(surface, std::vector<float>{0, 255, 0, 0}, kLevel, covers);
  ASSERT_EQ(covers.size(), surface.vertex_count());
  EXPECT_EQ(covers[0], 0);
  EXPECT_NEAR(covers[1], 1, 1e-6);
  std::size_t between = 0;
  for (const float cover : covers) {
    EXPECT_GE(cover, 0);
    EXPECT_LE(cover, 1);
    between += cover > 0 && cover < 1 ? 1 : 0;
  }
  EXPECT_GT(between, 0u);
}

TEST(BloodFilm, IsNowhereWhereTheSessionDoesNotBleed) {
  const SmoothSurface surface = square();
  std::vector<float> covers{1, 1};
  cover_with_blood(surface, {}, kLevel, covers);
  EXPECT_EQ(covers, std::vector<float>(surface.vertex_count(), 0));
}

TEST(BloodFilm, ItsBytesStandForMinusOneToOne) {
  EXPECT_EQ(lip_bytes({1, -1, 0}, 1), (std::array<std::int8_t, 4>{127, -127, 0, 127}));
  EXPECT_EQ(lip_bytes({0, 0, 1}, 0), (std::array<std::int8_t, 4>{0, 0, 127, 0}));
}

}  // namespace
}  // namespace trocar::shape
