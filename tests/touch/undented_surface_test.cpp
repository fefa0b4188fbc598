#include "server/tissue/touch/undented_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "server/tissue/step/simulation.h"
#include "tests/cutting/cut_organ.h"

namespace trocar::touch {
namespace {

constexpr float kRadius_m = 0.006f, kStep_m = 0.00025f;

// A block of 60 x 30 x 60 mm around the origin, and a round tip in it that points down.
class SharpEdge : public ::testing::Test {
 protected:
  SharpEdge() : simulation_(cutting::testing::box_organ(12, 6, 12, 0.005)) {
    surface_.settle(world(), layout(), {0.005f, 0.020f, 0});
  }

  const world::World& world() const { return simulation_.state().world; }
  const wire::SurfaceLayout& layout() const { return simulation_.layout(); }

  // The tip goes straight on in steps; whatever it goes over, the plane turns and moves gradually.
  void go(const Vec3f& from, const Vec3f& to) {
    const auto steps = static_cast<int>(std::ceil(length(to - from) / kStep_m));
    float most_turn = 0, most_deeper_m = 0, before_m = 0;
    Vec3f normal;
    for (int k = 0; k <= steps; ++k) {
      const Vec3f tip = from + (to - from) * (static_cast<float>(k) / static_cast<float>(steps));
      surface_.follow(world(), layout(), tip + Vec3f{0, kRadius_m, 0}, kRadius_m, false);
      last_ = surface_.felt_plane(tip, kRadius_m);
      depth_m_ = dot(last_.normal, last_.point - tip);
      if (k > 0) {
        most_turn = std::max(most_turn, length(last_.normal - normal));
        most_deeper_m = std::max(most_deeper_m, std::abs(depth_m_ - before_m));
      }
      normal = last_.normal;
      before_m = depth_m_;
    }
    const float most_deg = most_turn * 180 / std::numbers::pi_v<float>;
    std::printf("in a step of %.2f mm it turns by %.1f deg, and moves by %.2f mm\n", 1e3f * kStep_m,
                most_deg, 1e3f * most_deeper_m);
    EXPECT_LT(most_deg, 10);
    EXPECT_LT(most_deeper_m, 2 * kStep_m);
  }

  step::Simulation simulation_;
  UndentedSurface surface_;
  UndentedSurface::Plane last_{};
  float depth_m_ = 0;
};

TEST_F(SharpEdge, IsSlidOver) {
  go({0.005f, 0.018f, 0}, {0.005f, 0.011f, 0});
  EXPECT_NEAR(depth_m_, 0.004f, 1e-5f);
  EXPECT_GT(last_.normal.y, 0.999f);
  go({0.005f, 0.011f, 0}, {0.036f, 0.011f, 0});
  EXPECT_GT(last_.normal.x, 0.5f);
  EXPECT_LT(depth_m_, 0) << "it has come off";
}

TEST_F(SharpEdge, IsPressed) {
  go({0.028f, 0.018f, 0}, {0.028f, 0.008f, 0});
  EXPECT_GT(last_.normal.y, 0.7f) << "it has come from above";
  EXPECT_GT(depth_m_, 0.003f);
}

}  // namespace
}  // namespace trocar::touch
