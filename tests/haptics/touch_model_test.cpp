// Rules of the model, one by one, with patches made by hand.

#include "client/haptics/touch_model.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/tool/instrument.h"

namespace trocar::haptics {
namespace {

constexpr tool::ToolShape kShape{.radius_m = 0.006f, .length_m = 0.2f};
constexpr double kLateness_s = 0.1;

wire::HapticLaw law_of(std::uint32_t number) {
  wire::HapticLaw law;
  law.number = number;
  law.exponent = 1.3f;
  law.youngs_modulus_pa = 5300;
  law.relaxation[0] = {0.3f, 0.5f};
  law.fast[0] = {1.2f, 0.002f};
  return law;
}

// A tool that points down at a surface at height 0, moved along y; the server answers as it is
// told.
class Touch : public ::testing::Test {
 protected:
  explicit Touch(const TouchSettings& settings = {}) : model_(kShape, settings) {
    model_.take(law_of(1));
    patch_.plane_normal = {0, 1, 0};
    patch_.friction = 0.2f;
    patch_.law = 1;
    patch_.kind = wire::TouchKind::Near;
    input_.orientation = rotation_from_z({0, 1, 0});
    input_.time_us = 1'000'000;
  }

  Vec3d step(const Vec3d& tip_m) {
    input_.tip_m = tip_m;
    input_.time_us += 1000;
    return (output_ = model_.step(input_)).force_n;
  }
  void rest(int steps) {
    for (int k = 0; k < steps; ++k) step(input_.tip_m);
  }
  void answer(const Vec3d& force_n, double lateness_s = 0) {
    patch_.kind = wire::TouchKind::Push;
    patch_.force_n = to_float(force_n);
    send(lateness_s);
  }
  void send(double lateness_s = 0) {
    ++patch_.sequence;
    patch_.echo_time_us =
        input_.time_us - static_cast<std::uint64_t>(std::lround(lateness_s * 1e6));
    model_.take(patch_);
  }
  // Presses to a depth; the server says what the model says, times a factor.
  void press(double depth_m, double factor = 1) {
    for (int k = 0; k <= 200; ++k) {
      step({0, 0.001 - (depth_m + 0.001) * k / 200, 0});
      if (k % 16 == 0) k < 40 ? send() : answer(output_.force_n * factor);
    }
  }

  TouchModel model_;
  TouchInput input_;
  TouchOutput output_;
  wire::HapticPatch patch_;
};

TEST_F(Touch, FeelsNothingBeforeTheFirstPatch) {
  EXPECT_EQ(length(step({0, -0.005, 0})), 0);
  EXPECT_FALSE(output_.touches);
}

// The server expects tissue to be soft where a thin wall is near.
TEST_F(Touch, TheFirstTouchIsAsStiffAsTheServerExpects) {
  const auto expect = [&](float stiffness_n_m) {
    patch_.kind = wire::TouchKind::Near;
    patch_.force_n = {};
    patch_.has_stiffness = true;
    patch_.stiffness_n_m = {};
    patch_.stiffness_n_m.add_identity(stiffness_n_m);
    for (int k = 0; k < 200; ++k) {
      step({0, 0.010, 0});
      if (k % 16 == 0) send();
    }
  };
  expect(40);
  const double forty = model_.slope();
  expect(10);
  EXPECT_NEAR(model_.slope(), forty / 4, 1e-6);
  EXPECT_NEAR(step({0, -0.005, 0}).y, output_.stiffness_n_m * 0.005 / 1.3, 0.05);
  // It keeps what was felt, and carries it over to a place that should be twice as stiff.
  patch_.has_stiffness = false;
  press(0.006, 1.1);
  expect(10);
  const double felt = model_.slope();
  EXPECT_GT(felt, 1.1 * forty / 4);
  expect(20);
  EXPECT_NEAR(model_.slope(), 2 * felt, 1e-3 * felt);
}

TEST_F(Touch, FeelsNothingWhereNoTissueIsNear) {
  patch_.kind = wire::TouchKind::Free;
  send();
  EXPECT_EQ(length(step({0, -0.005, 0})), 0);
}

TEST_F(Touch, PushesOutAlongTheNormal) {
  step({0, 0.005, 0});
  send();
  const Vec3d force_n = step({0, -0.005, 0});
  EXPECT_GT(force_n.y, 0.1);
  EXPECT_EQ(force_n.x, 0);
  EXPECT_TRUE(output_.touches);
  EXPECT_GT(output_.stiffness_n_m, 20);
}

TEST_F(Touch, ATiltedToolTouchesWithItsRoundTip) {
  input_.orientation = rotation_from_z({1, 0, 0});
  step({0, 0.010, 0});
  send();
  // The centre of the tip is beside the tool's end, so its lowest point lies a radius below the
  // end.
  step({0, 0.0061, 0});
  EXPECT_FALSE(output_.touches);
  step({0, 0.0059, 0});
  EXPECT_TRUE(output_.touches);
}

TEST_F(Touch, AnAnswerThatTheModelGaveChangesNothing) {
  // The model's own force, late: it must not matter how late, for it is compared where it belongs.
  std::vector<Vec3d> forces_n;
  double greatest_n = 0;
  TouchModel alone(kShape);
  alone.take(law_of(1));
  input_.tip_m = {0, 0.001, 0};
  step(input_.tip_m);
  send();
  alone.take(patch_);
  for (int k = 0; k < 2000; ++k) {
    const double y = 0.001 - 0.005 * std::min(1.0, k / 200.0) + 0.001 * std::sin(0.02 * k);
    const Vec3d force_n = step({0, y, 0});
    forces_n.push_back(alone.step(input_).force_n);
    greatest_n = std::max(greatest_n, length(force_n - forces_n.back()));
    if (k % 16 == 0 && k > 350) {
      answer(forces_n[forces_n.size() - 101], kLateness_s);
    }
  }
  EXPECT_LT(greatest_n, 0.01);
  EXPECT_NEAR(model_.slope(), 1, 0.02);
  EXPECT_NEAR(model_.answer_s(), 0.1, 1e-3);
}

TEST_F(Touch, GoesToWhatTheServerSays) {
  press(0.006, 1);
  const Vec3d before_n = output_.force_n;
  for (int k = 0; k < 100; ++k) {
    answer({0, 0.5, 0});
    rest(16);
  }
  EXPECT_NEAR(output_.force_n.y, 0.5, 0.005);
  EXPECT_NE(before_n.y, output_.force_n.y);
}

TEST_F(Touch, AnOlderPatchIsDropped) {
  press(0.006);
  const auto sequence = patch_.sequence;
  patch_.sequence = sequence - 2;
  answer({0, 9, 0});
  EXPECT_EQ(model_.counts().old_patches, 1u);
  const double before_n = output_.force_n.y;
  rest(50);
  EXPECT_NEAR(output_.force_n.y, before_n, 0.05 * before_n);
}

TEST_F(Touch, SequencesWrapAround) {
  step({0, 0.001, 0});
  patch_.sequence = 0xfffffffe;
  send();
  send();  // 0
  EXPECT_EQ(model_.counts().old_patches, 0u);
  EXPECT_EQ(model_.counts().patches, 2u);
}

TEST_F(Touch, AServerThatCountsAnewIsHeard) {
  press(0.006);
  rest(1100);
  patch_.sequence = 0;
  answer(output_.force_n);
  EXPECT_EQ(model_.counts().old_patches, 0u);
}

TEST_F(Touch, APatchOfAnUnknownPoseCorrectsNothing) {
  step({0, 0.001, 0});
  send();
  press(0.006);
  patch_.kind = wire::TouchKind::Push;
  patch_.force_n = {0, 9, 0};
  ++patch_.sequence;
  patch_.echo_time_us = 5;
  model_.take(patch_);
  EXPECT_EQ(model_.counts().unmatched_patches, 1u);
  const double before_n = output_.force_n.y;
  rest(50);
  EXPECT_NEAR(output_.force_n.y, before_n, 0.05 * before_n);
}

TEST_F(Touch, NothingIsLeftInFreeSpaceWhateverTheServerSays) {
  press(0.006, 1.5);
  for (int k = 0; k < 100; ++k) {
    step({0, -0.006 + 0.0001 * k, 0});
    answer({0, 1, 0});  // of the past
    if (input_.tip_m.y > 0) {
      EXPECT_EQ(length(output_.force_n), 0);
    }
  }
}

TEST_F(Touch, TheCorrectionFadesWithTheContact) {
  press(0.006);
  for (int k = 0; k < 30; ++k) {
    answer({0, 1.2, 0});
    rest(16);
  }
  double last_n = output_.force_n.y, greatest_n = 0;
  for (int k = 0; k < 700; ++k) {
    step({0, -0.006 + 1e-5 * k, 0});
    greatest_n = std::max(greatest_n, std::abs(output_.force_n.y - last_n));
    last_n = output_.force_n.y;
  }
  EXPECT_EQ(last_n, 0);
  EXPECT_LT(greatest_n, 0.03);
}

// Beside friction the tissue may lean to a side, by a bounded share.
TEST_F(Touch, WhatActsAcrossIsBounded) {
  press(0.006);
  for (int k = 0; k < 100; ++k) {
    step({1e-4 * k, -0.006, 2e-4 * k});
    if (k % 16 == 0) answer({-5, 0.4, -5});
  }
  const double across_n = std::hypot(output_.force_n.x, output_.force_n.z);
  EXPECT_LE(across_n, (0.2 + SlopeFit::kMostLean) * output_.force_n.y + 1e-6);
  EXPECT_LT(output_.force_n.x, 0);
}

TEST_F(Touch, AMovedSurfaceBlends) {
  press(0.006);
  const double before_n = output_.force_n.y;
  double last_n = before_n, greatest_n = 0;
  patch_.plane_point_m = {0, 0.001f, 0};
  // 16 ms later nothing has been answered yet at the new place.
  answer({0, before_n, 0}, kLateness_s);
  for (int k = 0; k < 100; ++k) {
    greatest_n = std::max(greatest_n, std::abs(step(input_.tip_m).y - last_n));
    last_n = output_.force_n.y;
  }
  EXPECT_LT(greatest_n, 0.03);
}

// The greatest force while the surface rises by a millimetre at once and the server answers 0.1 s
// late; what it should be is 0.1 N more than before.
double peak_over_truth(double moved_share) {
  TouchSettings settings;
  settings.moved_share = moved_share;
  TouchModel model(kShape, settings), truth(kShape);
  wire::HapticPatch patch;
  patch.plane_normal = {0, 1, 0};
  patch.law = 1;
  patch.kind = wire::TouchKind::Near;
  TouchInput input;
  input.orientation = rotation_from_z({0, 1, 0});
  std::vector<Vec3d> truth_n;
  double peak_n = 0, peak_truth_n = 0;
  for (TouchModel* each : {&model, &truth}) each->take(law_of(1));
  for (int k = 0; k < 3000; ++k) {
    input.tip_m = {0, 0.001 - 0.006 * std::min(1.0, k / 300.0), 0};
    input.time_us = 1'000'000 + static_cast<std::uint64_t>(k) * 1000;
    const double height_m = k < 1500 ? 0 : 0.001;
    patch.plane_point_m = {0, static_cast<float>(height_m), 0};
    ++patch.sequence;
    patch.echo_time_us = input.time_us - 1000;
    wire::HapticPatch near = patch;
    near.kind = wire::TouchKind::Near;
    near.echo_time_us = 0;  // it moves the surface and corrects nothing
    truth.take(near);
    truth_n.push_back(truth.step(input).force_n);
    // The answer is of the pose 100 ms ago; it left 50 ms ago with the surface as it was then.
    if (k % 16 == 0 && k > 100) {
      wire::HapticPatch late = patch;
      const std::size_t left = truth_n.size() - 51;
      late.plane_point_m = {0, left < 1500 ? 0.0f : 0.001f, 0};
      late.force_n = to_float(truth_n[left]);
      late.kind = late.force_n.y > 0 ? wire::TouchKind::Push : wire::TouchKind::Near;
      late.echo_time_us = input.time_us - 100'000;
      model.take(late);
    }
    const double force_n = model.step(input).force_n.y;
    if (k > 1500) {
      peak_n = std::max(peak_n, force_n);
      peak_truth_n = std::max(peak_truth_n, truth_n.back().y);
    }
  }
  return peak_n - peak_truth_n;
}

TEST(TouchModel, AMovedSurfaceCountsOnce) {
  const double once_n = peak_over_truth(1), twice_n = peak_over_truth(0);
  EXPECT_LT(once_n, 0.02);
  EXPECT_GT(twice_n, 3 * std::max(once_n, 0.01));
}

TEST_F(Touch, ANewStructureIsBelievedAtOnce) {
  press(0.006);
  ++patch_.structure;
  answer(output_.force_n * 0.3);
  rest(60);
  EXPECT_NEAR(model_.slope(), 0.3, 0.05);
}

TEST_F(Touch, TissueThatTheServerDoesNotTouchGivesWay) {
  press(0.006);
  patch_.kind = wire::TouchKind::Near;
  patch_.force_n = {};
  for (int k = 0; k < 10; ++k) {
    send();
    rest(16);
  }
  EXPECT_LT(output_.force_n.y, 0.01);
}

TEST_F(Touch, TheSlopeStaysBetweenContactsAndByMaterial) {
  model_.take(law_of(2));
  patch_.has_stiffness = false;
  for (int k = 0; k < 3000; ++k) {
    step({0, -0.004 + 0.002 * std::sin(0.01 * k), 0});
    if (k == 0) send();
    if (k % 16 == 0 && k > 0) answer(Vec3d{0, 1.6, 0} * (0.25 + 0.1 * std::sin(0.01 * k - 3.14)));
  }
  const double learned = model_.slope();
  EXPECT_GT(std::abs(learned - 1), 0.1);
  patch_.kind = wire::TouchKind::Near;
  step({0, 0.01, 0});
  send();
  rest(100);
  EXPECT_NEAR(model_.slope(), learned, 0.05);
  patch_.law = 2;
  send();
  EXPECT_NEAR(model_.slope(), 1, 1e-6);
  patch_.law = 1;
  send();
  EXPECT_NEAR(model_.slope(), learned, 0.05);
}

TEST_F(Touch, AnotherLawChangesNoForceAtOnce) {
  press(0.006);
  wire::HapticLaw stiff = law_of(2);
  stiff.youngs_modulus_pa = 15000;
  model_.take(stiff);
  const double before_n = output_.force_n.y;
  patch_.law = 2;
  answer(output_.force_n);
  EXPECT_NEAR(step(input_.tip_m).y, before_n, 0.02);
  rest(30);  // stiffer tissue relaxes by more
  EXPECT_NEAR(output_.force_n.y, before_n, 0.1 * before_n);
}

TEST_F(Touch, ALawWithTheNumberOfTheOldTakesItsPlace) {
  press(0.006);
  const double stiffness_n_m = output_.stiffness_n_m, before_n = output_.force_n.y;
  model_.take(law_of(1));
  step(input_.tip_m);
  EXPECT_NEAR(output_.stiffness_n_m, stiffness_n_m, 0.05 * stiffness_n_m) << "the same law";
  wire::HapticLaw stiff = law_of(1);
  stiff.youngs_modulus_pa *= 3;
  model_.take(stiff);
  EXPECT_NEAR(step(input_.tip_m).y, before_n, 0.05);
  EXPECT_GT(output_.stiffness_n_m, 2 * stiffness_n_m);
}

TEST_F(Touch, ALawThatHasNotComeLeavesTheOneBefore) {
  press(0.006);
  const double before_n = output_.force_n.y;
  patch_.law = 77;
  answer(output_.force_n);
  EXPECT_NEAR(step(input_.tip_m).y, before_n, 0.02);
}

TEST_F(Touch, ARefusalStopsFromTheForceThatIsThere) {
  press(0.006);
  const double before_n = output_.force_n.y;
  patch_.kind = wire::TouchKind::Rigid;
  patch_.force_n = {0, 50, 0};  // of a stiff face under a hand of long ago
  ++patch_.structure;
  send(kLateness_s);
  EXPECT_NEAR(step(input_.tip_m).y, before_n, 0.03);
  for (int k = 0; k < 50; ++k) step(input_.tip_m - Vec3d{0, 1e-5, 0});
  rest(100);
  EXPECT_NEAR(output_.force_n.y, before_n + 0.5, 0.03);
  EXPECT_NEAR(output_.stiffness_n_m, 1000, 1e-6);
  const double stopped_n = output_.force_n.y;
  ++patch_.structure;
  answer({0, 0.4, 0});
  EXPECT_NEAR(step(input_.tip_m).y, stopped_n, 0.1);
  for (int k = 0; k < 20; ++k) {
    answer({0, 0.4, 0});
    rest(16);
  }
  EXPECT_NEAR(output_.force_n.y, 0.4, 0.02);
}

TEST_F(Touch, MoreThanIsPassedOnIsNotRendered) {
  press(0.006);
  const double before_n = output_.force_n.y;
  patch_.pressed_limit_n = 0.1f;
  answer({0, 0.1, 0});
  EXPECT_NEAR(step(input_.tip_m).y, before_n, 0.1 * before_n) << "no step";
  rest(400);
  EXPECT_NEAR(output_.force_n.y, 0.1, 1e-6);
}

// The hand goes far beyond where the tool is stopped, and comes back: what was known of the tissue
// is as it was.
TEST_F(Touch, AToolThatIsStoppedTeachesNothing) {
  press(0.004);
  for (int k = 0; k < 40; ++k) {
    answer(output_.force_n);
    rest(16);
  }
  const double slope = model_.slope(), before_n = output_.force_n.y;
  const Vec3d held_m = input_.tip_m;
  patch_.pressed_limit_n = static_cast<float>(before_n);
  for (int k = 0; k < 400; ++k) {
    if (k % 16 == 0) answer({0, before_n, 0});
    step(held_m - Vec3d{0, 0.004 * std::min(1.0, k / 200.0), 0});
  }
  EXPECT_NEAR(output_.force_n.y, before_n, 1e-3 * before_n) << "it grows no more";
  EXPECT_NEAR(model_.slope(), slope, 0.01 * slope);
}

// Instruments feel different already before the server has said anything about them.
TEST(Instruments, AWideTipIsStifferThanAThinOne) {
  const auto force_n = [](std::string_view kind) {
    TouchModel model(tool::find_instrument(kind)->shape);
    model.take(law_of(1));
    wire::HapticPatch patch;
    patch.plane_normal = {0, 1, 0};
    patch.kind = wire::TouchKind::Near;
    patch.law = 1;
    model.take(patch);
    TouchInput input;
    input.orientation = rotation_from_z({0, 1, 0});
    TouchOutput output;
    for (int k = 0; k <= 200; ++k) {
      input.time_us += 1000;
      input.tip_m.y = -0.004 * k / 200;
      output = model.step(input);
    }
    return output.force_n.y;
  };
  // Hertz: the force grows with the root of the radius, 5 and 1.5 mm.
  EXPECT_NEAR(force_n("probe") / force_n("scalpel"), std::sqrt(5 / 1.5), 0.1);
}

class Gripping : public Touch {
 protected:
  Gripping() {
    press(0.003);
    input_.verb = tool::Verb::Grasp;
    rest(100);
    patch_.kind = wire::TouchKind::Grip;
    patch_.grip_point_m = {0, -0.003f, 0};
    patch_.has_stiffness = true;
    patch_.stiffness_n_m = {};
    patch_.stiffness_n_m.add_identity(60);
    patch_.force_n = {0, 0.1f, 0};
    before_n_ = output_.force_n;
    ++patch_.structure;
    send(0.05);
  }
  Vec3d before_n_;
};

TEST_F(Gripping, BeginsWithTheForceThatIsThere) {
  EXPECT_NEAR(length(step(input_.tip_m) - before_n_), 0, 0.05);
}

TEST_F(Gripping, PullsBackOnAllAxes) {
  rest(100);
  const Vec3d held_n = output_.force_n, held_m = input_.tip_m;
  for (int k = 0; k <= 100; ++k) step(held_m + Vec3d{0.004, 0.005, -0.003} * (k / 100.0));
  const Vec3d pulled_n = output_.force_n - held_n;
  EXPECT_LT(pulled_n.x, -0.1);
  EXPECT_LT(pulled_n.y, -0.1);
  EXPECT_GT(pulled_n.z, 0.1);
}

TEST_F(Gripping, OpenJawsLetGoAtOnce) {
  for (int k = 0; k <= 100; ++k) step({0, -0.003 + 0.008 * k / 100, 0});
  EXPECT_LT(output_.force_n.y, -0.1);
  input_.verb = tool::Verb::Push;
  rest(21);
  EXPECT_EQ(length(output_.force_n), 0);
  send(0.05);  // the server still holds
  rest(16);
  EXPECT_EQ(length(output_.force_n), 0);
  patch_.kind = wire::TouchKind::Near;
  ++patch_.structure;
  send(0.05);
  rest(16);
  EXPECT_EQ(length(output_.force_n), 0) << "5 mm above the surface";
}

TEST_F(Gripping, JawsThatCloseAgainHoldOnceTheServerSaysSo) {
  for (int k = 0; k <= 100; ++k) step({0, -0.003 + 0.008 * k / 100, 0});
  input_.verb = tool::Verb::Push;
  rest(30);
  input_.verb = tool::Verb::Grasp;
  rest(30);
  send(0.05);  // of a pose before they closed
  rest(5);
  EXPECT_EQ(length(output_.force_n), 0);
  rest(60);
  send(0.02);
  rest(30);
  EXPECT_GT(length(output_.force_n), 0.02);
}

TEST_F(Gripping, ForceIsAtMostWhatTheJawsHold) {
  patch_.grip_limit_n = 0.2f;
  send();
  for (int k = 0; k <= 100; ++k) step({0, -0.003 + 0.02 * k / 100, 0});
  EXPECT_NEAR(length(output_.force_n), 0.2, 1e-6);
}

TEST_F(Touch, TheTorqueFollowsTheForce) {
  press(0.006);
  patch_.torque_nm = {0.004f, 0, 0.002f};
  for (int k = 0; k < 30; ++k) {
    answer({0, 0.4, 0});
    rest(16);
  }
  EXPECT_NEAR(output_.torque_nm.x, 0.004, 2e-4);
  EXPECT_NEAR(output_.torque_nm.z, 0.002, 1e-4);
  step({0, 0.001, 0});
  EXPECT_EQ(length(output_.torque_nm), 0);
}

TEST_F(Touch, ATimeThatDoesNotGrowChangesNothing) {
  press(0.006);
  const TouchOutput before = output_;
  input_.tip_m.y = -0.02;
  EXPECT_EQ(model_.step(input_).force_n, before.force_n);
}

TEST(TouchModel, IrregularStepsFeelTheSame) {
  TouchModel regular(kShape), irregular(kShape);
  wire::HapticPatch patch;
  patch.plane_normal = {0, 1, 0};
  patch.friction = 0.2f;
  patch.kind = wire::TouchKind::Near;
  patch.law = 1;
  for (TouchModel* model : {&regular, &irregular}) {
    model->take(law_of(1));
    model->take(patch);
  }
  double greatest_n = 0;
  for (int k = 0; k < 3000; ++k) {
    TouchInput input;
    input.orientation = rotation_from_z({0, 1, 0});
    input.time_us = 1'000'000 + static_cast<std::uint64_t>(k) * 1000;
    input.tip_m = {0.003 * std::sin(0.004 * k), -0.004 - 0.005 * std::cos(0.006 * k), 0};
    const Vec3d force_n = regular.step(input).force_n;
    // Every third step comes late, with the next one.
    if (k % 3 == 1) continue;
    greatest_n = std::max(greatest_n, length(irregular.step(input).force_n - force_n));
  }
  EXPECT_LT(greatest_n, 0.02);
}

TEST_F(Touch, ALongPauseIsSurvived) {
  press(0.006);
  input_.time_us += 30'000'000;
  EXPECT_TRUE(is_finite(step({0, -0.006, 0})));
  EXPECT_GT(output_.force_n.y, 0);
}

}  // namespace
}  // namespace trocar::haptics
