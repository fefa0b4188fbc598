#include "client/crtk/arm.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace trocar::crtk {
namespace {

constexpr std::uint64_t kMs = 1'000'000;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

class CrtkArm : public ::testing::Test {
 protected:
  CrtkArm() : arm_({"PSM1", {}, true, {0.1, 0, 0}, tool::Verb::Grasp}) {}

  void make_ready() {
    EXPECT_TRUE(arm_.follow("home").ok());
    arm_.step(now_ += kMs);
    arm_.step(now_ += kMs);
    EXPECT_TRUE(arm_.state().can_move());
  }
  ServoPose here() const {
    const auto& p = arm_.setpoint().position;
    const auto& q = arm_.setpoint().orientation;
    return {"", {p.x, p.y, p.z}, {q.x, q.y, q.z, q.w}};
  }
  Status take(const ServoPose& pose) { return arm_.take(pose, now_ += kMs); }
  void expect_refused(const Status& status, const std::string& says) {
    ASSERT_FALSE(status.ok()) << says;
    EXPECT_NE(status.error().message.find(says), std::string::npos) << status.error().message;
    EXPECT_EQ(status.error().message.find('\n'), std::string::npos);
  }

  Arm arm_;
  std::uint64_t now_ = 1'000 * kMs;
};

TEST_F(CrtkArm, FollowsServoOnlyWhenReady) {
  auto pose = here();
  pose.position_m[2] -= 0.002;
  expect_refused(take(pose), "DISABLED");
  EXPECT_TRUE(arm_.follow("enable").ok());
  expect_refused(take(pose), "not homed");
  make_ready();
  EXPECT_TRUE(take(pose).ok());
  EXPECT_NEAR(arm_.setpoint().position.z, pose.position_m[2], 1e-6);
  EXPECT_TRUE(arm_.follow("pause").ok());
  expect_refused(take(pose), "PAUSED");
}

TEST_F(CrtkArm, TheToolPassesThePortWithItsShaftOutwards) {
  const auto sample = arm_.sample();
  // The port is at +x: the tip lies between it and the organ, the shaft leads back to it.
  EXPECT_NEAR(sample.world_from_tool.position.x, 0.1 - (0.08 - 0.0156 + 0.0193), 1e-6);
  EXPECT_NEAR(sample.world_from_tool.position.y, 0, 1e-6);
  const auto back = rotate(sample.world_from_tool.orientation, {0, 0, 1});
  EXPECT_NEAR(back.x, 1, 1e-6);
}

TEST_F(CrtkArm, WhatIsNoPoseChangesNothing) {
  make_ready();
  const auto before = arm_.sample();
  for (int i = 0; i < 3; ++i) {
    auto pose = here();
    pose.position_m[static_cast<std::size_t>(i)] = i == 0 ? kNan : HUGE_VAL;
    expect_refused(take(pose), "no number");
  }
  auto pose = here();
  pose.orientation = {0, 0, 0, 0};
  expect_refused(take(pose), "length 0");
  pose.orientation = {0, 0, 0, kNan};
  expect_refused(take(pose), "no number");
  pose.orientation = {1e300, 0, 0, 0};
  expect_refused(take(pose), "length");
  pose = here();
  pose.frame = "world";
  expect_refused(take(pose), "PSM1_base");
  pose = here();
  pose.position_m[0] += 0.05;
  expect_refused(take(pose), "jumps");
  pose.position_m[0] = 1e300;
  expect_refused(take(pose), "jumps");
  pose = here();
  pose.orientation = {0, 0, 0, 1};
  expect_refused(take(pose), "jumps");
  EXPECT_EQ(arm_.sample(), before);
  EXPECT_TRUE(take(here()).ok());
}

TEST_F(CrtkArm, AStreamMayBeAsFastAsTheArm) {
  make_ready();
  auto pose = here();
  for (int i = 0; i < 20; ++i) {
    pose.position_m[0] += 0.003;
    EXPECT_TRUE(take(pose).ok()) << i;
  }
  pose.position_m[0] += 0.008;
  expect_refused(take(pose), "jumps");
}

TEST_F(CrtkArm, SaysOnceThatALimitKeepsTheTip) {
  make_ready();
  auto pose = here();
  int said = 0;
  for (int i = 0; i < 60; ++i) {
    pose.position_m[2] -= 0.003;
    EXPECT_TRUE(take(pose).ok());
    if (const auto notice = arm_.pop_notice()) {
      ++said;
      EXPECT_NE(notice->find("outer_insertion"), std::string::npos) << *notice;
    }
  }
  EXPECT_EQ(said, 1);
  EXPECT_NEAR(arm_.setpoint().position.z, -(0.24 - 0.0156 + 0.0193), 1e-5);
}

TEST_F(CrtkArm, AForceMovesItUntilTheTissuePressesBack) {
  make_ready();
  replica::Tool tool;
  Tick tick = 16;
  const auto see = [&] {
    tool.world_from_proxy = arm_.sample().world_from_tool;
    return arm_.measure(tool, tick += 16);
  };
  const auto push = [&](int frames) {
    for (int i = 0; i < frames; ++i) {
      EXPECT_TRUE(arm_.take(ServoWrench{"", {0, 0, -1}, {}}, now_ += 16 * kMs).ok());
      arm_.step(now_);
      see();
    }
  };
  see();
  const double from = arm_.setpoint().position.z;
  push(10);
  EXPECT_NEAR(arm_.setpoint().position.z, from - 0.004, 1e-5);  // 1 N / 40 N s/m for 0.16 s
  // Tissue that presses back as much, seen in the world: the base's +z is the world's +x.
  tool.force_n = {1, 0, 0};
  EXPECT_NEAR(see().force_n.z, 1, 1e-6);
  const double there = arm_.setpoint().position.z;
  push(10);
  EXPECT_NEAR(arm_.setpoint().position.z, there, 1e-6);
}

TEST_F(CrtkArm, AForceThatStopsComingStopsTheArm) {
  make_ready();
  replica::Tool tool;
  Tick tick = 16;
  arm_.measure(tool, tick);
  EXPECT_TRUE(arm_.take(ServoWrench{"", {0, 0, -5}, {}}, now_).ok());
  const auto go_on = [&] {
    for (int i = 0; i < 20; ++i) {
      arm_.step(now_ += 16 * kMs);
      arm_.measure(tool, tick += 16);
    }
    return arm_.setpoint().position.z;
  };
  const double there = go_on();
  EXPECT_NE(arm_.pop_notice().value_or("").find("stream has ended"), std::string::npos);
  EXPECT_EQ(go_on(), there);
}

TEST_F(CrtkArm, ForcesAreChecked) {
  make_ready();
  expect_refused(arm_.take(ServoWrench{"", {0, kNan, 0}, {}}, now_), "no number");
  expect_refused(arm_.take(ServoWrench{"", {0, 0, -11}, {}}, now_), "11 N");
  expect_refused(arm_.take(ServoWrench{"", {1e300, 0, 0}, {}}, now_), "at most 10 N");
  expect_refused(arm_.take(ServoWrench{"", {0, 0, 0}, {0, 0.1, 0}}, now_), "torque");
  expect_refused(arm_.take(ServoWrench{"tip", {0, 0, 0}, {}}, now_), "frame_id");
}

TEST_F(CrtkArm, JawsCloseAndOpenWithSomePlay) {
  make_ready();
  const auto verb_at = [&](double rad) {
    EXPECT_TRUE(arm_.take(ServoJaw{{rad}}).ok());
    return arm_.sample().verb;
  };
  EXPECT_EQ(verb_at(0.5), tool::Verb::Push);
  EXPECT_EQ(verb_at(0.1), tool::Verb::Push);
  EXPECT_EQ(verb_at(0.0), tool::Verb::Grasp);
  EXPECT_EQ(verb_at(0.1), tool::Verb::Grasp);
  EXPECT_EQ(verb_at(0.2), tool::Verb::Push);
  EXPECT_EQ(verb_at(-1e9), tool::Verb::Grasp);
  expect_refused(arm_.take(ServoJaw{{kNan}}), "one number");
  expect_refused(arm_.take(ServoJaw{{}}), "one number");
  expect_refused(arm_.take(ServoJaw{{0, 0}}), "one number");
}

TEST_F(CrtkArm, AFaultStopsItAndHomingBringsItBack) {
  make_ready();
  auto pose = here();
  for (int i = 0; i < 10; ++i) {
    pose.position_m[0] += 0.003;
    EXPECT_TRUE(take(pose).ok());
  }
  arm_.set_fault("the session cannot be reached");
  EXPECT_EQ(arm_.state().state, State::Fault);
  EXPECT_EQ(arm_.pop_notice(), "the session cannot be reached");
  expect_refused(take(here()), "FAULT");
  EXPECT_FALSE(arm_.follow("enable").ok());
  arm_.set_fault("");
  EXPECT_EQ(arm_.state().state, State::Fault);
  EXPECT_TRUE(arm_.follow("disable").ok());
  EXPECT_TRUE(arm_.follow("home").ok());
  EXPECT_TRUE(arm_.state().is_busy);
  for (int i = 0; i < 5'000 && arm_.state().is_busy; ++i) arm_.step(now_ += kMs);
  EXPECT_TRUE(arm_.state().can_move());
  EXPECT_NEAR(arm_.setpoint().position.x, 0, 1e-6);
}

TEST_F(CrtkArm, WhoIsHeldFollowsNothing) {
  make_ready();
  arm_.set_hold("Ada keeps the tool where it is");
  expect_refused(take(here()), "Ada");
  arm_.set_hold("");
  EXPECT_TRUE(take(here()).ok());
}

TEST_F(CrtkArm, SpeedsAreOfSimulatedTime) {
  replica::Tool tool;
  tool.world_from_proxy = arm_.sample().world_from_tool;
  arm_.measure(tool, 16);
  tool.world_from_proxy.position.x -= 0.0016f;
  const auto measured = arm_.measure(tool, 32);
  EXPECT_NEAR(measured.velocity_m_s.z, -0.1, 1e-4);
  EXPECT_NEAR(measured.joint_speeds[2], 0.1, 1e-4);
  EXPECT_NEAR(measured.turning_rad_s.x, 0, 1e-4);
}

}  // namespace
}  // namespace trocar::crtk
