// The forces of one contact point, against their energy and Coulomb's law.

#include "server/tissue/contact/contact_law.h"

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace trocar::contact {
namespace {

using trocar::testing::Random;

ContactPoint face() {
  return {.kind = ContactPoint::Kind::Push,
          .stiffness = 2000,
          .hold_stiffness = 1000,
          .friction = 0.3f,
          .limit_n = 5,
          .normal = normalized(Vec3f{1, 2, -0.5f}, {}),
          .plane = {0.001f, 0, 0.002f},
          .anchor = {0.0015f, 0, 0.001f}};
}

Vec3f random_vector(Random& random, float scale) {
  const auto one = [&] { return (random.unit() * 2 - 1) * scale; };
  return {static_cast<float>(one()), static_cast<float>(one()), static_cast<float>(one())};
}

TEST(ContactLaw, AFaceResistsAsTheDerivativeOfItsEnergyAndNeverPulls) {
  ContactPoint point = face();
  point.friction = 0;
  const auto energy = [&](const Vec3f& d) {
    const double gap = std::min(0.0, static_cast<double>(dot(point.normal, d - point.plane)));
    const double k = static_cast<double>(point.stiffness),
                 limit = static_cast<double>(point.limit_n);
    if (-k * gap < limit) return 0.5 * k * gap * gap;
    return -limit * gap - 0.5 * limit * limit / k;
  };
  Random random(1);
  int pressed = 0;
  for (int i = 0; i < 1000; ++i) {
    const Vec3f d = random_vector(random, 0.005f);
    const auto load = load_at(point, d);
    ASSERT_LE(dot(load.gradient, point.normal), 0) << "the face pushes the tissue out";
    pressed += load.pressed_n > 0;
    const float h = 1e-4f;
    const Vec3f along[3] = {{h, 0, 0}, {0, h, 0}, {0, 0, h}};
    const double component[3] = {load.gradient.x, load.gradient.y, load.gradient.z};
    for (int k = 0; k < 3; ++k) {
      const double slope = (energy(d + along[k]) - energy(d - along[k])) / (2.0 * h);
      ASSERT_NEAR(component[k], slope, 0.06 + 1e-3 * std::abs(slope));
    }
  }
  EXPECT_GT(pressed, 200);
}

TEST(ContactLaw, FrictionStaysInItsConeAndOpposesTheSlip) {
  const ContactPoint point = face();
  Random random(2);
  int sticks = 0, slides = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3f d = random_vector(random, 0.004f);
    const auto load = load_at(point, d);
    const Vec3f across = load.gradient - point.normal * dot(point.normal, load.gradient);
    ASSERT_LE(length(across), point.friction * load.pressed_n * 1.0001f + 1e-6f);
    ASSERT_GE(dot(across, load.slip), 0) << "minus the force on the tissue lies along its slip";
    if (load.pressed_n == 0) continue;
    (load.slides ? slides : sticks) += 1;
    if (load.slides) {
      ASSERT_NEAR(length(across), point.friction * load.pressed_n, 1e-3f);
    } else {
      ASSERT_NEAR(length(across - load.slip * point.hold_stiffness), 0, 1e-4f);
    }
  }
  EXPECT_GT(sticks, 50);
  EXPECT_GT(slides, 50);
}

TEST(ContactLaw, BlocksAreTheDerivativeWhereNothingSlides) {
  ContactPoint point = face();
  point.friction = 100;
  Random random(3);
  for (int i = 0; i < 500; ++i) {
    const Vec3f d = random_vector(random, 0.004f);
    const auto load = load_at(point, d);
    if (load.pressed_n < 0.5f || load.pressed_n > 4.5f || load.slides) continue;
    SymMat3f block;
    add_block(point, load, 1.0f, block);
    const float h = 1e-5f;
    const Vec3f step = random_vector(random, h);
    const Vec3f change = load_at(point, d + step).gradient - load_at(point, d - step).gradient;
    const Vec3f expected = block * step * 2.0f;
    ASSERT_NEAR(length(change - expected), 0, 0.01f * length(expected) + 2e-4f);
  }
}

TEST(ContactLaw, AGripHoldsInAllDirectionsUpToItsForce) {
  const ContactPoint point{.kind = ContactPoint::Kind::Grip,
                           .stiffness = 1000,
                           .limit_n = 0.5f,
                           .anchor = {0.001f, 0.002f, 0.003f}};
  const auto held = load_at(point, point.anchor + Vec3f{0, 0.0004f, 0});
  EXPECT_FALSE(held.slides);
  EXPECT_NEAR(held.gradient.y, 0.4f, 1e-4f);
  const auto slipping = load_at(point, point.anchor + Vec3f{0.002f, 0, 0});
  EXPECT_TRUE(slipping.slides);
  EXPECT_NEAR(slipping.gradient.x, 0.5f, 1e-5f);
}

}  // namespace
}  // namespace trocar::contact
