// A state with a negative weight is refused when it is read: none may be made.

#include <gtest/gtest.h>

#include <cmath>

#include "common/math/nearest_point.h"
#include "tests/support/random.h"

namespace trocar::testing {
namespace {

TEST(NearestPoint, WeightsAreNeverNegativeAndSumToOne) {
  Random random(1);
  const auto component = [&] { return static_cast<float>(random.between(-0.01, 0.01)); };
  const auto vector = [&] { return Vec3f{component(), component(), component()}; };
  for (int i = 0; i < 1'000'000; ++i) {
    const Vec3f away = vector() * 10, a = away + vector(), b = away + vector(), c = away + vector();
    // Each point lies on an edge but for rounding, and to one side of the triangle.
    const auto t = static_cast<float>(random.unit());
    const Vec3f up = cross(b - a, c - a) * static_cast<float>(random.between(-3, 3));
    const Vec3f p = b * t + c * (1 - t) + up;
    const Vec3f w = nearest_weights(p, a, b, c);
    ASSERT_TRUE(w.x >= 0 && w.y >= 0 && w.z >= 0) << w.x << " " << w.y << " " << w.z;
    ASSERT_NEAR(w.x + w.y + w.z, 1, 1e-6);
  }
}

}  // namespace
}  // namespace trocar::testing
