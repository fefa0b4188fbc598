#include "common/wire/quantise.h"

#include <gtest/gtest.h>

#include <limits>
#include <numeric>

#include "common/base/bytes.h"
#include "common/base/checksum.h"
#include "common/math/morton.h"
#include "tests/wire/surface_states.h"

namespace trocar::wire {
namespace {

std::int32_t quantise_x(float quanta, std::int32_t old) {
  const Vec3f displacement{quanta * kQuantumMetres, 0, 0};
  QuantisedVertex q{old, 0, 0};
  quantise({&displacement, 1}, {&q, 1});
  return q.x;
}

TEST(quantise, keeps_its_integer_within_three_quarters) {
  EXPECT_EQ(quantise_x(0.74f, 0), 0);
  EXPECT_EQ(quantise_x(0.76f, 0), 1);
  EXPECT_EQ(quantise_x(-0.74f, 0), 0);
  EXPECT_EQ(quantise_x(-0.76f, 0), -1);
  EXPECT_EQ(quantise_x(9.26f, 10), 10);
  EXPECT_EQ(quantise_x(9.24f, 10), 9);
  EXPECT_EQ(quantise_x(1000.4f, 0), 1000);  // once it moves, to the nearest
}

TEST(quantise, slow_noise_does_not_flicker) {
  testing::Random random(1);
  int changes = 0, plain_changes = 0;
  std::int32_t q = 0, plain = 0;
  for (int i = 0; i < 1000; ++i) {
    const float value = 0.5f + static_cast<float>(random.within(200)) * 1e-3f;  // 0.3 to 0.7
    const std::int32_t next = quantise_x(value, q);
    changes += next != q;
    q = next;
    const auto rounded = static_cast<std::int32_t>(std::lround(value));
    plain_changes += rounded != plain;
    plain = rounded;
  }
  EXPECT_EQ(changes, 0);
  EXPECT_GT(plain_changes, 300);  // what plain rounding would send
}

TEST(quantise, error_is_at_most_three_quarters_on_every_axis) {
  testing::Random random(2);
  std::vector<Vec3f> displacements(500);
  QuantisedSurface quantised(500);
  for (int frame = 0; frame < 200; ++frame) {
    for (Vec3f& d : displacements) {
      const auto step = testing::random_vertex(random, 3000);
      d += Vec3f{static_cast<float>(step.x), static_cast<float>(step.y),
                 static_cast<float>(step.z)} *
           1e-8f;
    }
    quantise(displacements, quantised);
    for (std::size_t i = 0; i < quantised.size(); ++i) {
      const Vec3f error = to_metres(quantised[i]) - displacements[i];
      const float largest = std::max({std::abs(error.x), std::abs(error.y), std::abs(error.z)});
      ASSERT_LE(largest, 0.7501f * kQuantumMetres);
    }
  }
}

TEST(quantise, clamps_to_one_metre_and_ignores_nan) {
  EXPECT_EQ(quantise_x(1e9f, 3), kMaxQuanta);
  EXPECT_EQ(quantise_x(-1e9f, 3), -kMaxQuanta);
  EXPECT_EQ(quantise_x(std::numeric_limits<float>::infinity(), 3), kMaxQuanta);
  EXPECT_EQ(quantise_x(std::numeric_limits<float>::quiet_NaN(), 3), 3);
  EXPECT_FLOAT_EQ(to_metres({kMaxQuanta, 0, 0}).x, 1.0f);
}

TEST(quantise, rest_is_rounded_to_the_grid) {
  const std::vector<Vec3d> rest{{0, 32e-6, -32e-6}, {47e-6, -49e-6, 0.1}, {2.0, 0, 0}};
  EXPECT_EQ(quantise_rest(rest),
            (std::vector<QuantisedVertex>{{0, 1, -1}, {1, -2, 3125}, {62500, 0, 0}}));
}

TEST(quantise, crc_covers_the_integers_as_they_lie) {
  const QuantisedSurface surface{{1, -1, 256}};
  const Bytes bytes{1, 0, 0, 0, 0xff, 0xff, 0xff, 0xff, 0, 1, 0, 0};
  EXPECT_EQ(surface_crc(surface), crc32(bytes));
  EXPECT_EQ(surface_crc({}), 0u);
}

TEST(morton_order, walks_the_cube_corner_by_corner) {
  std::vector<Vec3d> corners;  // x slowest, so not already in order
  for (int i = 0; i < 8; ++i)
    corners.push_back({double(i >> 2), double(i >> 1 & 1), double(i & 1)});
  EXPECT_EQ(morton_order(corners), (std::vector<std::uint32_t>{0, 4, 2, 6, 1, 5, 3, 7}));
}

TEST(morton_order, ties_by_index_and_degenerate_boxes) {
  EXPECT_TRUE(morton_order({}).empty());
  const std::vector<Vec3d> same(5, {0.1, 0.2, 0.3});
  EXPECT_EQ(morton_order(same), (std::vector<std::uint32_t>{0, 1, 2, 3, 4}));
  const std::vector<Vec3d> line{{3, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  EXPECT_EQ(morton_order(line), (std::vector<std::uint32_t>{1, 2, 0}));
}

TEST(morton_order, is_a_permutation_with_near_neighbours) {
  testing::Random random(3);
  std::vector<Vec3d> points;
  for (int i = 0; i < 2000; ++i) {
    const auto v = testing::random_vertex(random, 1000);
    points.push_back({v.x * 1e-4, v.y * 1e-4, 0.0});
  }
  const auto order = morton_order(points);
  auto sorted = order;
  std::sort(sorted.begin(), sorted.end());
  std::vector<std::uint32_t> all(points.size());
  std::iota(all.begin(), all.end(), 0u);
  EXPECT_EQ(sorted, all);

  double along_curve = 0, along_index = 0;
  for (std::size_t i = 1; i < order.size(); ++i) {
    along_curve += length(points[order[i]] - points[order[i - 1]]);
    along_index += length(points[i] - points[i - 1]);
  }
  EXPECT_LT(along_curve * 10, along_index);
}

}  // namespace
}  // namespace trocar::wire
