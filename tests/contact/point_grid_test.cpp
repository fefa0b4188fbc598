// The grid is compared with looking at every point.

#include "server/tissue/contact/point_grid.h"

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace trocar::contact {
namespace {

using trocar::testing::Random;

// Some points lie far beyond the cells that a grid has at most.
std::vector<Vec3f> random_points(Random& random, std::size_t count, float size_m) {
  std::vector<Vec3f> points(count);
  for (auto& p : points) {
    const float scale = random.below(20) == 0 ? 50 * size_m : size_m;
    const auto one = [&] { return static_cast<float>(random.unit() * 2 - 1) * scale; };
    p = {one(), one(), one()};
  }
  return points;
}

TEST(PointGrid, FindsAllWithinTheRangeEachOnceAndNothingElse) {
  constexpr float kCell_m = 0.01f;
  Random random(1);
  PointGrid grid(kCell_m, 500);
  for (const std::size_t count : {0u, 1u, 7u, 8u, 9u, 100u, 500u}) {
    const auto points = random_points(random, count, 0.03f);
    grid.build(count, [&](std::size_t i) { return points[i]; });
    EXPECT_EQ(grid.entries().size(), count);
    for (int look = 0; look < 100; ++look) {
      const Vec3f p = look < 50 || count == 0
                          ? random_points(random, 1, 0.04f)[0]
                          : points[random.below(static_cast<std::uint32_t>(count))];
      const float range = kCell_m * static_cast<float>(random.unit());
      std::vector<int> found(count);
      grid.visit(p, range, [&](std::uint32_t entry, float squared) {
        ++found[entry];
        EXPECT_EQ(squared, length_squared(points[entry] - p));
      });
      for (std::size_t i = 0; i < count; ++i)
        ASSERT_EQ(found[i], length_squared(points[i] - p) <= range * range ? 1 : 0) << i;
    }
  }
}

}  // namespace
}  // namespace trocar::contact
