// The film that is drawn is the blood that the state says, and it runs into a wound first.

#include "client/shape/blood_film.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/client/cut_liver.h"
#include "tests/support/random.h"

namespace trocar::shape {
namespace {

constexpr float kLevel = 20e-6f;

// The server counts it so, too: a third of the triangles around a vertex, at rest.
std::vector<double> areas_of(const testing::CutLiver& cut) {
  std::vector<double> areas(cut.rest.size());
  for (const auto& t : cut.triangles) {
    const double area = 0.5 * static_cast<double>(length(cross(cut.rest[t[1]] - cut.rest[t[0]],
                                                               cut.rest[t[2]] - cut.rest[t[0]])));
    for (const std::uint32_t v : t) areas[v] += area / 3;
  }
  return areas;
}

SmoothSurface surface_of(const testing::CutLiver& cut) {
  SmoothSurface surface;
  surface.build(cut.positions.size(), cut.triangles, cut.layout.is_wound, 24'000);
  surface.update(cut.positions);
  return surface;
}

// Returns what comes out of the bytes that the shader takes, m^3.
double volume_of_bytes(const BloodFilm& film) {
  double sum = 0;
  for (std::size_t v = 0; v < film.depths().size(); ++v) {
    const double share = lip_bytes({0, 0, 1}, film.depths()[v])[3] / 127.0;
    sum += share * share * share * static_cast<double>(kDeepestFilmMetres * film.areas()[v]);
  }
  return sum;
}

TEST(BloodFilm, WhatTheStateSaysIsDrawn) {
  const auto& cut = testing::cut_liver();
  const SmoothSurface surface = surface_of(cut);
  BloodFilm film;
  film.build(surface, cut.rest);
  const auto areas = areas_of(cut);
  testing::Random random(3);
  for (int wet = 1; wet <= 1000; wet *= 10) {  // from one vertex in a thousand to all
    std::vector<float> levels(cut.rest.size());
    double told = 0;
    for (std::size_t v = 0; v < levels.size(); ++v) {
      if (static_cast<int>(random.below(1000)) < wet)
        levels[v] = static_cast<float>(1 + random.below(40));
      told += static_cast<double>(levels[v] * kLevel) * areas[v];
    }
    film.spread(surface, levels, kLevel);
    EXPECT_NEAR(film.volume_m3(), told, 1e-3 * told) << wet;
    EXPECT_NEAR(volume_of_bytes(film), told, 0.02 * told) << wet;
    EXPECT_GE(std::ranges::min(film.depths()), 0) << wet;
  }
}

TEST(BloodFilm, RunsIntoTheWoundAndNotUpItsLip) {
  const auto& cut = testing::cut_liver();
  const SmoothSurface surface = surface_of(cut);
  BloodFilm film;
  film.build(surface, cut.rest);
  std::vector<float> levels(cut.rest.size());
  for (std::size_t t = 0; t < cut.triangles.size(); ++t)
    if (cut.layout.is_wound[t] != 0)
      for (const std::uint32_t v : cut.triangles[t]) levels[v] = 20;
  film.spread(surface, levels, kLevel);
  double outside = 0, inside = 0;
  for (std::size_t v = 0; v < surface.vertex_count(); ++v)
    (surface.is_wound()[v] != 0 ? inside : outside) +=
        static_cast<double>(film.depths()[v] * film.areas()[v]);
  EXPECT_GT(inside, 0);
  EXPECT_LT(outside, 1e-3 * inside) << "all that bleeds at the rim is in the wound";
  // It stays on the outside where that is wet, too.
  std::ranges::fill(levels, 20.0f);
  film.spread(surface, levels, kLevel);
  double area = 0;
  outside = 0;
  for (std::size_t v = 0; v < surface.vertex_count(); ++v)
    if (surface.is_wound()[v] == 0) {
      area += static_cast<double>(film.areas()[v]);
      outside += static_cast<double>(film.depths()[v] * film.areas()[v]);
    }
  EXPECT_NEAR(outside / area, 20 * static_cast<double>(kLevel),
              0.05 * 20 * static_cast<double>(kLevel));
}

// A border that followed the triangles would fall from all to nothing within one of them.
TEST(BloodFilm, HasABorderThatIsWiderThanATriangle) {
  const auto& cut = testing::cut_liver();
  const SmoothSurface surface = surface_of(cut);
  BloodFilm film;
  film.build(surface, cut.rest);
  std::vector<float> levels(cut.rest.size());
  for (std::size_t v = 0; v < levels.size(); ++v) levels[v] = cut.rest[v].x < 0 ? 20.0f : 0.0f;
  film.spread(surface, levels, kLevel);
  float steepest = 0;
  for (std::size_t t = 0; t < 3 * surface.triangles().size(); ++t) {
    const auto& corners = surface.triangles()[t / 3];
    if (surface.is_wound()[corners[0]] != 0) continue;
    steepest = std::max(
        steepest, std::abs(film.depths()[corners[t % 3]] - film.depths()[corners[(t + 1) % 3]]));
  }
  EXPECT_GT(steepest, 0);
  EXPECT_LT(steepest, 0.45f * 20 * kLevel);
}

TEST(BloodFilm, IsNowhereWhereTheSessionDoesNotBleed) {
  const auto& cut = testing::cut_liver();
  const SmoothSurface surface = surface_of(cut);
  BloodFilm film;
  film.build(surface, cut.rest);
  film.spread(surface, std::vector<float>(cut.rest.size(), 5), kLevel);
  EXPECT_FALSE(film.is_dry());
  film.spread(surface, {}, kLevel);
  EXPECT_TRUE(film.is_dry());
  EXPECT_EQ(film.depths(), std::vector<float>(surface.vertex_count(), 0));
}

TEST(BloodFilm, ItsBytesStandForMinusOneToOne) {
  EXPECT_EQ(lip_bytes({1, -1, 0}, kDeepestFilmMetres),
            (std::array<std::int8_t, 4>{127, -127, 0, 127}));
  EXPECT_EQ(lip_bytes({0, 0, 1}, 0), (std::array<std::int8_t, 4>{0, 0, 127, 0}));
  EXPECT_EQ(lip_bytes({0, 0, 1}, 1)[3], 127) << "what is deeper is drawn as the deepest";
}

}  // namespace
}  // namespace trocar::shape
