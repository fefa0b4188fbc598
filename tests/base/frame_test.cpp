#include "common/math/frame.h"

#include <gtest/gtest.h>

#include <random>

namespace trocar {
namespace {

class Random {
 public:
  Quatf rotation() {
    return normalized(
        Quatf{normal_(engine_), normal_(engine_), normal_(engine_), normal_(engine_)});
  }
  Vec3f vector() { return {normal_(engine_), normal_(engine_), normal_(engine_)}; }

 private:
  std::mt19937 engine_{11};
  std::normal_distribution<float> normal_;
};

TEST(Frame, AQuarterTurnAboutEachAxis) {
  const float h = std::sqrt(0.5f);
  const auto near = [](const Vec3f& a, const Vec3f& b) { return length(a - b) < 1e-6f; };
  EXPECT_TRUE(near(rotate({h, 0, 0, h}, {0, 1, 0}), {0, 0, 1}));
  EXPECT_TRUE(near(rotate({0, h, 0, h}, {0, 0, 1}), {1, 0, 0}));
  EXPECT_TRUE(near(rotate({0, 0, h, h}, {1, 0, 0}), {0, 1, 0}));
}

TEST(Frame, RotationsKeepLengthAnglesAndHandedness) {
  Random random;
  for (int i = 0; i < 1000; ++i) {
    const Quatf q = random.rotation();
    const Vec3f a = random.vector(), b = random.vector();
    const float scale = 1 + length(a) * length(b);
    EXPECT_NEAR(dot(rotate(q, a), rotate(q, b)), dot(a, b), 1e-5f * scale);
    EXPECT_NEAR(length(rotate(q, cross(a, b)) - cross(rotate(q, a), rotate(q, b))), 0,
                2e-5f * scale);
  }
}

TEST(Frame, ProductsAreCompositionsAndConjugatesUndo) {
  Random random;
  for (int i = 0; i < 1000; ++i) {
    const Quatf p = random.rotation(), q = random.rotation();
    const Vec3f v = random.vector();
    EXPECT_NEAR(length(rotate(p * q, v) - rotate(p, rotate(q, v))), 0, 2e-5f);
    EXPECT_NEAR(length(rotate(conjugate(q), rotate(q, v)) - v), 0, 2e-5f);
  }
}

TEST(Frame, PosesGoThereAndBack) {
  Random random;
  for (int i = 0; i < 1000; ++i) {
    const Pose pose{random.vector(), random.rotation()};
    const Vec3f v = random.vector();
    EXPECT_NEAR(length(pose.apply_inverse(pose.apply(v)) - v), 0, 2e-5f);
  }
}

TEST(Frame, RotationFromZReachesEveryDirectionAlsoTheOppositeOne) {
  Random random;
  const auto check = [](const Vec3f& d) {
    const Quatf q = rotation_from_z(d);
    EXPECT_NEAR(norm(q), 1, 1e-6f);
    // Half-way quaternions lose digits next to the opposite pole.
    EXPECT_NEAR(length(rotate(q, {0, 0, 1}) - d), 0, 2e-3f);
  };
  for (int i = 0; i < 1000; ++i) check(normalized(random.vector(), {0, 0, 1}));
  check({0, 0, 1});
  check({0, 0, -1});
  check(normalized(Vec3f{1e-3f, 0, -1}, {}));
  check({1, 0, 0});
}

TEST(Frame, InterpolationStartsEndsAndTakesTheShorterArc) {
  Random random;
  for (int i = 0; i < 1000; ++i) {
    const Quatf a = random.rotation(), b = random.rotation();
    const Quatf minus_b{-b.x, -b.y, -b.z, -b.w};
    const Vec3f v = random.vector();
    EXPECT_NEAR(length(rotate(interpolate(a, b, 0), v) - rotate(a, v)), 0, 1e-5f);
    EXPECT_NEAR(length(rotate(interpolate(a, b, 1), v) - rotate(b, v)), 0, 1e-5f);
    EXPECT_NEAR(
        length(rotate(interpolate(a, b, 0.3f), v) - rotate(interpolate(a, minus_b, 0.3f), v)), 0,
        1e-4f)
        << "q and -q are the same rotation";
  }
}

}  // namespace
}  // namespace trocar
