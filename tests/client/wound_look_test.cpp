// This shows what a wound looks like after a real operation, without drawing it: the triangles at
// its rim must be shaded as one smooth lip.
//
// The bounds are what an eye tells apart: facets that meet at less than 30 degrees pass as one
// round surface, which is also where modelling programs cease to smooth. Within one triangle light
// may turn by a right angle, from a wall to the outside; what turns farther glitters. Normals that
// lean away from their triangle are counted, too: walls of two cuts share them at a fold, and the
// shader leans them back.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>

#include "client/shape/smooth_surface.h"
#include "tests/client/cut_liver.h"

namespace trocar::shape {
namespace {

constexpr float kAcrossTheRim = 30, kWithinATriangle = 90, kFromTheFace = 90;  // degrees

float degrees_between(const Vec3f& a, const Vec3f& b) {
  return std::acos(std::clamp(dot(a, b), -1.0f, 1.0f)) * 180 / std::numbers::pi_v<float>;
}

struct Jumps {
  int triangles = 0;  // at the rim
  int across = 0, within = 0, turned = 0;
};

Jumps count_jumps(const SmoothSurface& surface) {
  using Point = std::array<float, 3>;
  const auto point = [&](std::uint32_t v) {
    const Vec3f& p = surface.positions()[v];
    return Point{p.x, p.y, p.z};
  };
  // Vertices of either side at one place; at a closed tip there may be several.
  std::map<Point, std::array<std::vector<std::uint32_t>, 2>> places;
  for (const auto& t : surface.triangles())
    for (const auto v : t) {
      auto& side = places[point(v)][surface.is_wound()[v]];
      if (std::ranges::find(side, v) == side.end()) side.push_back(v);
    }
  Jumps jumps;
  for (const auto& t : surface.triangles()) {
    const auto at = [&](std::size_t k) { return surface.positions()[t[k % 3]]; };
    const auto normal = [&](std::size_t k) { return surface.normals()[t[k % 3]]; };
    const Vec3f face = cross(at(1) - at(0), at(2) - at(0));
    bool is_at_rim = false, across = false, within = false, turned = false;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& others = places[point(t[k])][1 - surface.is_wound()[t[k]]];
      is_at_rim |= !others.empty();
      float nearest = others.empty() ? 0.0f : 180.0f;
      for (const auto other : others)
        nearest = std::min(nearest, degrees_between(surface.lips()[t[k]], surface.lips()[other]));
      across |= nearest > kAcrossTheRim;
      within |= degrees_between(normal(k), normal(k + 1)) > kWithinATriangle;
      turned |= length(face) > 1e-10f &&
                degrees_between(normal(k), normalized(face * 1e6f, normal(k))) > kFromTheFace;
    }
    if (!is_at_rim) continue;
    ++jumps.triangles;
    jumps.across += across, jumps.within += within, jumps.turned += turned;
  }
  return jumps;
}

TEST(WoundLook, EightCutsHaveSmoothLips) {
  const testing::CutLiver& cut = testing::cut_liver();
  ASSERT_GT(std::ranges::count(cut.layout.is_wound, 1), 200);
  SmoothSurface surface;
  for (const std::size_t budget : {std::size_t{24'000}, std::size_t{100'000}}) {
    surface.build(cut.positions.size(), cut.triangles, cut.layout.is_wound, budget);
    surface.update(cut.positions);
    const Jumps jumps = count_jumps(surface);
    std::printf("%zu triangles, %d at the rim: %d jump across it, %d within, %d turned\n",
                surface.triangles().size(), jumps.triangles, jumps.across, jumps.within,
                jumps.turned);
    EXPECT_GT(jumps.triangles, 200);
    EXPECT_EQ(jumps.across, 0);
    EXPECT_EQ(jumps.within, 0);
  }
}

// A roof of 20 cells with rows of vertices at its slopes, whose ridge goes up and down by `jag_m`.
struct Roof {
  std::vector<Vec3f> rest;
  std::vector<TriangleCorners> triangles;
  static constexpr std::uint32_t kRows = 9, kColumns = 21, kRidge = 4;
};

Roof roof(float jag_m, float slope) {
  Roof made;
  for (std::uint32_t row = 0; row < Roof::kRows; ++row)
    for (std::uint32_t column = 0; column < Roof::kColumns; ++column) {
      const float across = 0.006f * (static_cast<float>(row) - Roof::kRidge);
      const float jag = row != Roof::kRidge ? 0 : column % 2 == 0 ? jag_m : -jag_m;
      made.rest.push_back(
          {0.006f * static_cast<float>(column), jag - slope * std::abs(across), across});
    }
  for (std::uint32_t row = 0; row + 1 < Roof::kRows; ++row)
    for (std::uint32_t column = 0; column + 1 < Roof::kColumns; ++column) {
      const std::uint32_t a = row * Roof::kColumns + column, b = a + Roof::kColumns;
      made.triangles.push_back({a, b, a + 1});
      made.triangles.push_back({a + 1, b, b + 1});
    }
  return made;
}

TEST(Borders, ThatTetsMakeJaggedAreSmoothLines) {
  const Roof made = roof(0.001f, 1.5f);
  SmoothSurface surface;
  surface.build(made.rest.size(), made.triangles, {}, 1);
  surface.smooth_borders(made.rest);
  surface.update(made.rest);
  float high = -1, low = 1;
  for (std::size_t v = 0; v < made.rest.size(); ++v) {
    const std::size_t row = v / Roof::kColumns, column = v % Roof::kColumns;
    EXPECT_LE(length(surface.positions()[v] - made.rest[v]), kMostLiftMetres * 1.001f);
    if (row != Roof::kRidge) {
      EXPECT_EQ(surface.positions()[v], made.rest[v]) << "no border";
    } else if (column > 2 && column + 3 < Roof::kColumns) {
      high = std::max(high, surface.positions()[v].y),
      low = std::min(low, surface.positions()[v].y);
    }
  }
  EXPECT_LT(high - low, 0.0005f) << "it went up and down by 2 mm";
}

TEST(Borders, AreNoneOnWhatIsRoundOrOnABox) {
  for (const float slope : {0.1f, 0.0f}) {
    const Roof made = roof(0, slope);
    SmoothSurface surface;
    surface.build(made.rest.size(), made.triangles, {}, 1);
    surface.smooth_borders(made.rest);
    surface.update(made.rest);
    for (std::size_t v = 0; v < made.rest.size(); ++v)
      EXPECT_EQ(surface.positions()[v], made.rest[v]);
  }
  const std::vector<Vec3f> box{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                               {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  const std::vector<TriangleCorners> sides{{0, 2, 1}, {0, 3, 2}, {4, 5, 6}, {4, 6, 7},
                                           {0, 1, 5}, {0, 5, 4}, {2, 3, 7}, {2, 7, 6},
                                           {1, 2, 6}, {1, 6, 5}, {0, 4, 7}, {0, 7, 3}};
  SmoothSurface surface;
  surface.build(box.size(), sides, {}, 1);
  surface.smooth_borders(box);
  surface.update(box);
  EXPECT_TRUE(std::ranges::equal(box, std::span(surface.positions()).first(box.size())));
}

}  // namespace
}  // namespace trocar::shape
