// A blade in tissue as the model renders it, with patches made by hand.

#include <gtest/gtest.h>

#include "client/haptics/touch_model.h"

namespace trocar::haptics {
namespace {

// A blade points down at a surface at height 0. It has gone in along y, and stands. The server
// feels no force of cutting then; it says what it would be.
class Cutting : public ::testing::Test {
 protected:
  static constexpr double kDeep_m = 0.010;

  Cutting() : model_({.radius_m = 0.001f, .length_m = 0.2f, .edge_m = 0.03f}) {
    wire::HapticLaw law;
    law.number = patch_.law = 1;
    law.exponent = 1.3f;
    law.youngs_modulus_pa = 5300;
    model_.take(law);
    patch_.plane_normal = {0, 1, 0};
    patch_.kind = wire::TouchKind::Near;
    input_.orientation = rotation_from_z({0, 1, 0});
    for (int k = 0; k <= 200; ++k) {
      step({0, 0.001 - (kDeep_m + 0.001) * k / 200, 0});
      if (k % 16 == 0) send();
      if (k == 100) patch_.kind = wire::TouchKind::Cut;
    }
    patch_.cut_force_n = 1.5f;
    for (int k = 0; k < 40; ++k) {
      rest(16);
      send();
    }
  }

  Vec3d step(const Vec3d& tip_m) {
    input_.tip_m = tip_m;
    input_.time_us += 1000;
    return (output_ = model_.step(input_)).force_n;
  }
  void rest(int steps) {
    for (int k = 0; k < steps; ++k) step(input_.tip_m);
  }
  void send() {
    ++patch_.sequence;
    patch_.echo_time_us = input_.time_us;
    model_.take(patch_);
  }

  TouchModel model_;
  TouchInput input_;
  TouchOutput output_;
  wire::HapticPatch patch_;
};

TEST_F(Cutting, AHandThatGoesOnIsHeldBackAtOnceAndNoMoreThanTheServerSays) {
  EXPECT_LT(length(output_.force_n), 0.01);
  for (int k = 0; k <= 1000; ++k) step({0, -kDeep_m, 0.02 * k / 1000});  // nothing is answered
  EXPECT_NEAR(output_.force_n.z, -1.5, 0.03);
}

TEST_F(Cutting, ABladeThatIsDrawnOutIsHeldBackByWhatIsInTissue) {
  for (int k = 0; k <= 1000; ++k) step({0, -kDeep_m, 0.02 * k / 1000});
  const double deep_n = -output_.force_n.z;
  step({0, -kDeep_m / 2, 0.0201});
  EXPECT_NEAR(-output_.force_n.z / deep_n, 0.5, 0.06);
  step({0, 0.003, 0.0202});
  EXPECT_EQ(output_.force_n, Vec3d{}) << "it is out";
}

TEST_F(Cutting, FrictionAtItsSidesTurnsWithTheHand) {
  patch_.cut_force_n = 0;
  patch_.side_friction_n = 0.2f;
  send();
  rest(100);
  for (int k = 0; k <= 100; ++k) step({0, -kDeep_m - 1e-5 * k, 0});
  EXPECT_NEAR(output_.force_n.y, 0.2, 0.04);
  for (int k = 0; k <= 50; ++k) step({0, -kDeep_m - 0.001 + 1e-5 * k, 0});  // nothing is answered
  EXPECT_NEAR(output_.force_n.y, -0.2, 0.04);
}

}  // namespace
}  // namespace trocar::haptics
