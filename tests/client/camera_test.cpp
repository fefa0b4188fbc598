// The camera that follows another view.

#include "client/render/camera.h"

#include <gtest/gtest.h>

#include <cmath>

namespace trocar::render {
namespace {

using shape::lens_of;

TEST(OrbitCamera, StandsWhereAnotherViewStands) {
  constexpr Size kSize{1280, 720};
  OrbitCamera leads, follows;
  leads.frame({0.01f, 0.02f, 0.03f}, 0.12f);
  follows.frame({}, 0.12f);
  for (int i = 0; i < 20; ++i) {
    leads.orbit(0.7f, 0.2f);
    leads.zoom(i % 2 == 0 ? 0.8f : 1.2f);
    const auto wanted = leads.rays(kSize);
    follows.look(wanted.eye, leads.centre());
    const auto view = follows.rays(kSize);
    EXPECT_LT(length(view.eye - wanted.eye), 1e-5f) << i;
    EXPECT_LT(length(view.forward - wanted.forward), 1e-4f) << i;
    EXPECT_LT(length(view.up - wanted.up), 1e-4f) << i;
  }
}

TEST(Lens, AnEndoscopeLooksOnOrThirtyDegreesAsideAndStaysUpright) {
  const Pose pose{{0, 0.1f, 0.2f}, rotation_from_z({0, 0, 1})};
  const Lens straight = lens_of(pose, {.form = tool::Form::Endoscope});
  EXPECT_LT(length(straight.forward - Vec3f{0, 0, -1}), 1e-5f);
  EXPECT_TRUE(straight.is_endoscope);
  for (const float turn : {0.0f, 0.7f, 2.0f}) {
    const Pose turned{pose.position,
                      pose.orientation * Quatf{0, 0, std::sin(turn / 2), std::cos(turn / 2)}};
    const Lens aside = lens_of(turned, {.form = tool::Form::Endoscope30});
    EXPECT_NEAR(dot(aside.forward, straight.forward), std::sqrt(0.75f), 1e-4f);
    EXPECT_NEAR(dot(aside.up, aside.forward), 0, 1e-5f);
    EXPECT_GT(aside.up.y, 0.8f);
    OrbitCamera camera;
    camera.look_through(aside);
    EXPECT_LT(length(rotate(camera.orientation(), {0, 0, 1}) + aside.forward), 1e-4f);
    EXPECT_LT(length(rotate(camera.orientation(), {0, 1, 0}) - aside.up), 1e-4f);
    const auto seen = camera.project(aside.eye + aside.forward * 0.05f, {1280, 720});
    ASSERT_TRUE(seen);
    EXPECT_NEAR(seen->x, 640, 0.1f);
    EXPECT_NEAR(seen->y, 360, 0.1f);
  }
  EXPECT_FALSE(lens_of(pose, {.form = tool::Form::Scalpel}).is_endoscope);
}

}  // namespace
}  // namespace trocar::render
