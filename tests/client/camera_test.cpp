// The camera that follows another view.

#include "client/render/camera.h"

#include <gtest/gtest.h>

namespace trocar::render {
namespace {

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

}  // namespace
}  // namespace trocar::render
