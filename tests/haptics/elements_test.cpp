// Parts of the local model against closed forms, and its derivatives against finite differences.

#include <gtest/gtest.h>

#include <cmath>

#include "client/haptics/blade_element.h"
#include "client/haptics/grip_element.h"
#include "client/haptics/push_element.h"

namespace trocar::haptics {
namespace {

constexpr double kDt_s = 0.001;

wire::HapticLaw elastic_law() {
  wire::HapticLaw law;
  law.exponent = 1.3f;
  law.youngs_modulus_pa = 5300;
  law.poisson_ratio = 0.49f;
  return law;
}

TEST(PowerLaw, StiffnessIsTheDerivativeOfTheForce) {
  const PowerLaw law{200, 1.3};
  for (const double depth_m : {1e-4, 1.9e-4, 2.1e-4, 0.001, 0.005, 0.02}) {
    constexpr double kStep_m = 1e-8;
    const double difference =
        (law.force_n(depth_m + kStep_m) - law.force_n(depth_m - kStep_m)) / (2 * kStep_m);
    EXPECT_NEAR(law.stiffness_n_m(depth_m) / difference, 1, 1e-5) << depth_m;
  }
}

TEST(PowerLaw, IsContinuousAndZeroAbove) {
  const PowerLaw law{200, 1.5};
  const double joint_m = PowerLaw::kLinearDepth_m;
  EXPECT_NEAR(law.force_n(joint_m * (1 - 1e-9)) / law.force_n(joint_m * (1 + 1e-9)), 1, 1e-6);
  EXPECT_EQ(law.force_n(0), 0);
  EXPECT_EQ(law.force_n(-0.001), 0);
  EXPECT_GT(law.stiffness_n_m(-0.001), 0);
}

TEST(PowerLaw, FirstGuessIsHertzAtFiveMillimetres) {
  const double modulus_pa = 5300 / (1 - 0.49 * 0.49);
  const double hertz_n_m = 2 * modulus_pa * std::sqrt(0.006 * 0.005);
  EXPECT_NEAR(first_guess(elastic_law(), 0.006).stiffness_n_m(0.005) / hertz_n_m, 1, 1e-6);
}

TEST(ViscoElement, RelaxesAsAPronySeries) {
  wire::HapticLaw law = elastic_law();
  law.relaxation[0] = {0.5f, 0.05f};
  law.relaxation[1] = {0.2f, 0.4f};
  const ViscoSteps steps(law, kDt_s);
  ViscoElement<double> element;
  double force = 0;
  for (int k = 0; k < 300; ++k) force = element.step(steps, 1, 0);
  // The force grew over the first step, so half of it is younger.
  const double s = 299.5 * kDt_s;
  EXPECT_NEAR(force, 0.3 + 0.5 * std::exp(-s / 0.05) + 0.2 * std::exp(-s / 0.4), 1e-4);
}

TEST(ViscoElement, IsExactForARamp) {
  wire::HapticLaw law = elastic_law();
  law.relaxation[0] = {0.6f, 0.03f};
  for (const double dt_s : {0.001, 0.02}) {
    const ViscoSteps steps(law, dt_s);
    ViscoElement<double> element;
    double force = 0;
    const int count = static_cast<int>(std::lround(0.1 / dt_s));
    for (int k = 1; k <= count; ++k) force = element.step(steps, k * dt_s, 0);
    const double share = static_cast<double>(law.relaxation[0].share);
    const double time_s = static_cast<double>(law.relaxation[0].time_s);
    EXPECT_NEAR(force, (1 - share) * 0.1 + share * time_s * (1 - std::exp(-0.1 / time_s)), 1e-12);
  }
}

TEST(ViscoElement, FastTermsDampASteadyMotion) {
  wire::HapticLaw law = elastic_law();
  law.fast[0] = {1.2f, 0.002f};
  law.fast[1] = {0.4f, 0.010f};
  const ViscoSteps steps(law, kDt_s);
  ViscoElement<double> element;
  constexpr double kStiffness_n_m = 100, kSpeed_m_s = 0.02;
  double force = 0;
  for (int k = 0; k < 500; ++k) force = element.step(steps, 0, kStiffness_n_m * kSpeed_m_s * kDt_s);
  EXPECT_NEAR(force, kStiffness_n_m * kSpeed_m_s * (1.2 * 0.002 + 0.4 * 0.010), 1e-6);
}

TEST(ViscoElement, WhatWasTakenBackWasNeverThere) {
  wire::HapticLaw law = elastic_law();
  law.relaxation[0] = {0.5f, 0.5f};
  law.fast[0] = {1.2f, 0.002f};
  const ViscoSteps steps(law, kDt_s);
  ViscoElement<double> moved, still;
  for (int k = 1; k <= 20; ++k) {
    moved.step(steps, k * 0.1, 0.1);
    still.step(steps, k * 0.1, 0.1);
  }
  moved.step(steps, 2.5, 0.5);
  moved.take_back(steps, 0.5);
  still.step(steps, 2.0, 0);
  EXPECT_NEAR(moved.step(steps, 2.0, 0), still.step(steps, 2.0, 0), 1e-3);
}

TEST(ViscoElement, RelaxedShareIsThatOfAStep) {
  wire::HapticLaw law = elastic_law();
  law.relaxation[0] = {0.5f, 0.05f};
  law.fast[0] = {1.2f, 0.02f};
  EXPECT_NEAR(relaxed_share(law, 0), 2.2, 1e-6);
  EXPECT_NEAR(relaxed_share(law, 0.05), 0.5 + 0.5 * std::exp(-1.0) + 1.2 * std::exp(-2.5), 1e-6);
}

class Push : public ::testing::Test {
 protected:
  Response step(const Vec3d& place_m, const Vec3d& normal = {0, 0, 1}) {
    return element_.step(law_, steps_, -dot(place_m, normal), place_m, normal, 0.3);
  }
  PowerLaw law_{200, 1.3};
  ViscoSteps steps_{elastic_law(), kDt_s};
  PushElement element_;
};

TEST_F(Push, AnswersAlongTheNormalOnly) {
  const Response response = step({0.01, 0.02, -0.005});
  EXPECT_NEAR(response.normal_n, law_.force_n(0.005), 1e-12);
  EXPECT_EQ(length(response.rest_n), 0);
  EXPECT_NEAR(response.stiffness_n_m, law_.stiffness_n_m(0.005), 1e-9);
}

TEST_F(Push, SticksToItsAnchor) {
  step({0, 0, -0.005});
  const Response response = step({0.0001, -0.0002, -0.005});
  const double stiffness = kAcrossOverNormal * law_.stiffness_n_m(0.005);
  EXPECT_NEAR(response.rest_n.x, -stiffness * 0.0001, 1e-12);
  EXPECT_NEAR(response.rest_n.y, stiffness * 0.0002, 1e-12);
  EXPECT_EQ(response.rest_n.z, 0);
}

TEST_F(Push, SlidesAtCoulombsLimitAgainstTheMotion) {
  Response response;
  for (int k = 0; k < 200; ++k) response = step({k * 1e-4, k * 2e-4, -0.005});
  EXPECT_NEAR(length(response.rest_n), 0.3 * response.normal_n, 1e-9);
  EXPECT_NEAR(response.rest_n.y / response.rest_n.x, 2, 1e-3);
  EXPECT_LT(response.rest_n.x, 0);
  // The anchor came along: on the way back the force turns within the same slip.
  const double slip_m = 2 * length(response.rest_n) / (kAcrossOverNormal * response.stiffness_n_m);
  const Vec3d last{199e-4, 398e-4, -0.005};
  response = step(last - Vec3d{1, 2, 0} * (slip_m / std::sqrt(5.0)));
  EXPECT_NEAR(length(response.rest_n), 0.3 * response.normal_n, 1e-6);
  EXPECT_GT(response.rest_n.x, 0);
}

TEST_F(Push, ATurningNormalKeepsTheForceInThePlane) {
  for (int k = 0; k < 50; ++k) step({k * 1e-5, 0, -0.005});
  const Vec3d normal = normalized(Vec3d{0.1, 0.2, 1}, {0, 0, 1});
  const Response before = step({49e-5, 0, -0.005});
  const Response after = step({49e-5, 0, -0.005}, normal);
  EXPECT_NEAR(dot(after.rest_n, normal), 0, 1e-12);
  EXPECT_NEAR(length(after.rest_n) / length(before.rest_n), 1, 0.05);
}

TEST_F(Push, NothingIsLeftAbove) {
  for (int k = 0; k < 50; ++k) step({k * 1e-4, 0, -0.005});
  const Response response = step({0.005, 0, 0.0001});
  EXPECT_EQ(response.normal_n, 0);
  EXPECT_EQ(length(response.rest_n), 0);
}

TEST(GripElement, PullsBackAlongAllAxes) {
  SymMat3<double> stiffness;
  stiffness.add_identity(70);
  stiffness.add_outer({0, 0, 1}, 30);
  GripElement grip;
  grip.start(stiffness);
  const ViscoSteps steps(elastic_law(), kDt_s);
  const Vec3d force_n = grip.step(steps, {0.001, -0.002, 0.003}, {0, 0, 0.001}).rest_n;
  EXPECT_NEAR(force_n.x, -0.07, 1e-9);
  EXPECT_NEAR(force_n.y, 0.14, 1e-9);
  EXPECT_NEAR(force_n.z, -0.2, 1e-9);
}

TEST(GripElement, ANewStiffnessChangesNoForceThatIsThere) {
  SymMat3<double> soft, stiff;
  soft.add_identity(50);
  stiff.add_identity(100);
  GripElement grip;
  grip.start(soft);
  const ViscoSteps steps(elastic_law(), kDt_s);
  grip.step(steps, {0.002, 0, 0}, {});
  grip.set_stiffness(stiff);
  EXPECT_NEAR(grip.step(steps, {0.002, 0, 0}, {}).rest_n.x, -0.1, 1e-9);
  EXPECT_NEAR(grip.step(steps, {0.003, 0, 0}, {}).rest_n.x, -0.2, 1e-9);
}

constexpr Vec3d kUp{0, 0, 1};

TEST(BladeElement, IsHeldBackAgainstItsWayByTheEdgeInTissue) {
  BladeElement blade;
  blade.start({});
  Vec3d tip_m;
  const auto move = [&](const Vec3d& way_m, int steps, double length_m) {
    Response response;
    for (int k = 0; k < steps; ++k)
      response = blade.step(tip_m += way_m / steps, kUp, length_m, 0, kDt_s);
    return response.rest_n;
  };
  EXPECT_EQ(move({0, 0, -0.01}, 100, 0.01), Vec3d{}) << "along its edge it cuts nothing";
  const Vec3d there_n = move({0.02, 0, 0}, 1000, 0.01);
  EXPECT_NEAR(there_n.x, -BladeElement::kEnergy_j_m2 * 0.01, 2e-3);
  EXPECT_NEAR(there_n.z, 0, 1e-12);
  EXPECT_NEAR(move({0.0001, 0, 0}, 5, 0.005).x, there_n.x / 2, 2e-3) << "half of it is in tissue";
  EXPECT_GT(move({-0.01, 0, 0}, 500, 0.01).x, 0.9) << "it turns back";
  EXPECT_NEAR(length(move({}, 1000, 0.01)), 0, 1e-3) << "it stands";
  EXPECT_EQ(move({0.01, 0, 0}, 500, -0.01), Vec3d{}) << "it is out";
}

TEST(BladeElement, StepsOfAnEncoderAreNoRests) {
  const auto felt_n = [](double step_m) {
    BladeElement blade;
    blade.start({});
    Response response;
    for (int k = 1; k <= 4000; ++k)  // at 5 mm/s
      response = blade.step({std::round(5e-6 * k / step_m) * step_m, 0, 0}, kUp, 0.01, 0, kDt_s);
    return -response.rest_n.x;
  };
  EXPECT_NEAR(felt_n(20e-6), felt_n(1e-9), 0.01 * felt_n(1e-9));
}

TEST(BladeElement, ItsSidesAreHeldUntilFrictionGivesWay) {
  constexpr double kFriction_n = 0.2;
  BladeElement blade;
  blade.start({});
  const auto sides_n = [&](double height_m) {
    return blade.step({0, 0, height_m}, kUp, 0.01, kFriction_n, kDt_s).sides_n.z;
  };
  EXPECT_NEAR(sides_n(-2e-5), BladeElement::kSides_n_m * 2e-5, 1e-12) << "it sticks";
  double work_j = 0, last_m = -2e-5;
  const auto go_to = [&](double height_m) {
    for (int k = 1; k <= 100; ++k) {
      const double next_m = last_m + (height_m - last_m) / (101 - k);
      work_j += sides_n(next_m) * (next_m - last_m);
      last_m = next_m;
    }
  };
  go_to(-0.005);
  EXPECT_NEAR(sides_n(-0.005), kFriction_n, 1e-12);
  go_to(0);
  EXPECT_NEAR(sides_n(0), -kFriction_n, 1e-12);
  EXPECT_LT(work_j, -0.9 * kFriction_n * 0.0095) << "it takes work both ways";
  EXPECT_EQ(blade.step({0, 0, 0.001}, kUp, -0.001, 0, kDt_s).sides_n, Vec3d{}) << "it is out";
}

}  // namespace
}  // namespace trocar::haptics
