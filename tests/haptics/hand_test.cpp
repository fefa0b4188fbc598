// A hand step by step on a fake device, and the loop around it. This program counts allocations.

#include "client/haptics/hand.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <thread>

#include "client/haptics/loop.h"
#include "tests/haptics/fake_device.h"
#include "tests/support/counted_allocations.h"

namespace trocar::haptics {
namespace {

using testing::FakeDevice;

HandSettings settings() {
  HandSettings settings;
  settings.shape = {.radius_m = 0.006f, .length_m = 0.2f};
  return settings;
}

class HandTest : public ::testing::Test {
 protected:
  HandTest() {
    wire::HapticLaw law;
    law.number = 1;
    law.relaxation[0] = {0.5f, 0.5f};
    law.fast[0] = {1, 0.002f};
    EXPECT_TRUE(hand_.put(law));
    hand_.put_view(
        rotation_from_z({0, 1, 0}));  // the hand pulls up: the device's z is the world's y
  }
  // One step; the tip is at this height over the surface.
  void step(double height_m) {
    now_us_ += 1000;
    device_.reading.position_m.z = height_m;
    device_.reading.time_us = now_us_;
    EXPECT_TRUE(hand_.step(now_us_));
  }
  void touch(double force_n) {
    wire::HapticPatch patch;
    patch.sequence = ++sequence_;
    patch.kind = force_n > 0 ? wire::TouchKind::Push : wire::TouchKind::Near;
    patch.plane_normal = {0, 1, 0};
    patch.force_n = {0, static_cast<float>(force_n), 0};
    patch.echo_time_us = now_us_;
    patch.law = 1;
    hand_.put(patch);
  }
  // Goes down to 5 mm within a second, after the ramp.
  void press() {
    for (int k = 0; k < 1000; ++k) {
      if (k % 16 == 0) touch(hand_force_n());
      step(k < 300 ? 0.0 : -0.005 * std::min(1.0, (k - 300) / 300.0));
    }
  }
  double hand_force_n() const { return device_.last_force_n.z; }

  FakeDevice device_;
  Hand hand_{device_, settings()};
  std::uint64_t now_us_ = 1'000'000;
  std::uint32_t sequence_ = 0;
};

TEST_F(HandTest, RendersInTheDevicesFrame) {
  press();
  EXPECT_GT(hand_force_n(), 0.1);
  EXPECT_NEAR(device_.last_force_n.x, 0, 1e-6);
  EXPECT_NEAR(device_.last_force_n.y, 0, 1e-6);
  HandState state;
  ASSERT_TRUE(hand_.take_state(state));
  EXPECT_GT(state.model_force_n.y, 0.1);
  EXPECT_EQ(state.hand_force_n, device_.last_force_n);
  EXPECT_NEAR(state.reading.tip_m.y, -0.005, 1e-6);
  EXPECT_EQ(state.steps, 1000u);
  EXPECT_GT(state.patches.patches, 50u);
  HandReading reading;
  ASSERT_TRUE(hand_.take_reading(reading));
  EXPECT_EQ(reading.time_us, now_us_);
}

TEST_F(HandTest, AViewTurnsMotionsAndLeavesTheToolWhereItIs) {
  HandReading before, after;
  step(0.02);
  ASSERT_TRUE(hand_.take_reading(before));
  const Quatf from_the_right{0, std::sqrt(0.5f), 0, std::sqrt(0.5f)};  // right is -z of the world
  hand_.put_view(from_the_right);
  step(0.02);
  ASSERT_TRUE(hand_.take_reading(after));
  EXPECT_NEAR(length(after.tip_m - before.tip_m), 0, 1e-12);
  device_.reading.position_m = {0.010, 0.003, 0};
  step(0.015);
  ASSERT_TRUE(hand_.take_reading(after));
  const Vec3d way = after.tip_m - before.tip_m;
  EXPECT_NEAR(way.x, -0.005, 1e-8) << "5 mm into the picture";
  EXPECT_NEAR(way.y, 0.003, 1e-8) << "up";
  EXPECT_NEAR(way.z, -0.010, 1e-8) << "right";
}

// A force that turned in a hand that holds still would do work out of nothing.
TEST_F(HandTest, AViewWaitsUntilTheToolTouchesNothing) {
  press();
  const Vec3d before_n = device_.last_force_n;
  HandReading before, after;
  ASSERT_TRUE(hand_.take_reading(before));
  const Quatf upside_down{0, 0, 1, 0};
  hand_.put_view(upside_down);
  for (int k = 0; k < 20; ++k) step(-0.005);
  EXPECT_LT(length(device_.last_force_n - before_n), 0.05 * length(before_n));
  ASSERT_TRUE(hand_.take_reading(after));
  EXPECT_EQ(after.orientation, before.orientation);
  for (int k = 0; k < 400; ++k) {
    if (k % 16 == 0) touch(0);
    step(std::min(0.02, -0.005 + 0.0005 * k));
  }
  EXPECT_EQ(length(device_.last_force_n), 0);
  ASSERT_TRUE(hand_.take_reading(after));
  EXPECT_FALSE(after.orientation == before.orientation) << "taken over in free space";
}

TEST_F(HandTest, AReportHasTheForceInTheWorld) {
  press();
  HandState report;
  ASSERT_TRUE(hand_.take_report(report));
  EXPECT_EQ(report.time_us, now_us_);
  EXPECT_NEAR(report.hand_force_in_world_n.y, hand_force_n(), 1e-6);
  EXPECT_NEAR(report.hand_force_in_world_n.z, 0, 1e-6);
  EXPECT_GE(report.largest_force_n, hand_force_n());
  EXPECT_FALSE(hand_.take_report(report)) << "once";
  HandState state;
  EXPECT_TRUE(hand_.take_state(state)) << "for somebody else";
}

TEST_F(HandTest, DoesNotAllocate) {
  press();
  const std::size_t before = allocations;
  press();
  EXPECT_EQ(allocations, before);
}

TEST_F(HandTest, ABrokenReadingIsNoForceAndLeavesNoTrace) {
  press();
  const double before_n = hand_force_n();
  device_.reading.position_m.x = NAN;
  step(-0.005);
  EXPECT_EQ(length(device_.last_force_n), 0);
  device_.reading.position_m.x = 0;
  device_.reading.orientation = {0, 0, 0, 0};
  step(-0.005);
  EXPECT_EQ(length(device_.last_force_n), 0);
  device_.reading.orientation = {};
  for (int k = 0; k < 300; ++k) {
    if (k % 16 == 0) touch(before_n);
    step(-0.005);
  }
  EXPECT_NEAR(hand_force_n(), before_n, 0.1 * before_n);
}

TEST_F(HandTest, AnOldReadingIsNoForce) {
  press();
  now_us_ += 30'000;
  EXPECT_TRUE(hand_.step(now_us_));
  EXPECT_EQ(length(device_.last_force_n), 0);
}

TEST_F(HandTest, AServerThatFallsSilentFades) {
  press();
  const double before_n = hand_force_n();
  for (int k = 0; k < 2000; ++k) step(-0.005);
  EXPECT_LT(hand_force_n(), 0.01 * before_n);
}

TEST_F(HandTest, GripperAndButtonsAreVerbs) {
  HandReading reading;
  const auto verb = [&](float gripper, std::uint32_t buttons) {
    device_.reading.gripper = gripper;
    device_.reading.buttons = buttons;
    step(0.01);
    EXPECT_TRUE(hand_.take_reading(reading));
    return reading.verb;
  };
  EXPECT_EQ(verb(0, 0), tool::Verb::Push);
  EXPECT_EQ(verb(0.7f, 0), tool::Verb::Grasp);
  EXPECT_EQ(verb(0.5f, 0), tool::Verb::Grasp) << "it opens later than it closes";
  EXPECT_EQ(verb(0.3f, 0), tool::Verb::Push);
  EXPECT_EQ(verb(0.5f, 0), tool::Verb::Push);
  EXPECT_EQ(verb(0, 2), tool::Verb::Cut);
  const Vec3d before_m = reading.tip_m;
  device_.reading.buttons = 1;
  step(0.02);
  ASSERT_TRUE(hand_.take_reading(reading));
  EXPECT_NEAR(length(reading.tip_m - before_m), 0, 1e-9) << "the clutch";
}

TEST(HandVerbs, AreThoseOfTheTool) {
  const auto verbs = [](tool::Verb gripper, tool::Verb button) {
    FakeDevice device;
    HandSettings held = settings();
    held.gripper_verb = gripper;
    held.button_verb = button;
    Hand hand(device, held);
    std::array<tool::Verb, 5> found{};
    std::size_t count = 0;
    std::uint64_t now_us = 1000;
    for (const auto& [closed, buttons] : {std::pair{0.0f, 0u},
                                          {1.0f, 0u},
                                          {0.0f, 2u},
                                          {1.0f, 2u},
                                          {1.0f, 2u | device::kRestsButton}}) {
      device.reading.gripper = closed;
      device.reading.buttons = buttons;
      device.reading.time_us = now_us += 1000;
      EXPECT_TRUE(hand.step(now_us));
      HandReading reading;
      EXPECT_TRUE(hand.take_reading(reading));
      found[count++] = reading.verb;
    }
    return found;
  };
  using enum tool::Verb;
  EXPECT_EQ(verbs(Grasp, Cut), (std::array{Push, Grasp, Cut, Cut, None}));
  EXPECT_EQ(verbs(Push, Push), (std::array{Push, Push, Push, Push, None})) << "a probe";
  EXPECT_EQ(verbs(Grasp, Grasp), (std::array{Push, Grasp, Grasp, Grasp, None}));
  EXPECT_EQ(verbs(Cut, Push), (std::array{Push, Cut, Push, Cut, None}));
}

TEST_F(HandTest, AHandThatRestsFeelsNothing) {
  press();
  ASSERT_GT(hand_force_n(), 0.1);
  device_.reading.buttons = device::kRestsButton;
  for (int k = 0; k < 20; ++k) step(-0.005);
  EXPECT_EQ(length(device_.last_force_n), 0);
}

TEST_F(HandTest, ADeviceThatWasTakenAgainLeavesTheToolWhereItWas) {
  HandReading before, after;
  step(0.01);
  ASSERT_TRUE(hand_.take_reading(before));
  device_.reading.buttons = device::kLetGoButton;
  step(0.04);
  device_.reading.buttons = 0;
  step(0.04);
  ASSERT_TRUE(hand_.take_reading(after));
  EXPECT_NEAR(length(after.tip_m - before.tip_m), 0, 1e-9);
  EXPECT_EQ(after.verb, tool::Verb::Push);
}

// The port is above the surface, and the device pushes the handle sideways: the tip goes the other
// way, and so does what it feels.
TEST(HandAtAPort, PivotsAndFeelsThroughThePivot) {
  FakeDevice device;
  HandSettings held = settings();
  held.shape.length_m = 0.3f;
  held.port_m = Vec3d{0, 0, 0.1};
  Hand hand(device, held);
  std::uint64_t now_us = 1000;
  std::uint32_t sequence = 0;
  HandReading reading;
  const auto step = [&](const Vec3d& place_m) {
    device.reading.position_m = place_m;
    device.reading.time_us = now_us += 1000;
    EXPECT_TRUE(hand.step(now_us));
    EXPECT_TRUE(hand.take_reading(reading));
  };
  const auto answer = [&](const Vec3f& normal, float force_n) {
    wire::HapticPatch patch;
    patch.sequence = ++sequence;
    patch.kind = wire::TouchKind::Push;
    patch.plane_normal = normal;
    patch.plane_point_m = to_float(reading.tip_m) + normal * (0.004f - 0.006f);
    patch.force_n = normal * force_n;
    patch.echo_time_us = now_us;
    hand.put(patch);
  };
  step({});
  EXPECT_NEAR(length(reading.tip_m), 0, 1e-9) << "it starts where it is told";
  step({0.002, 0, 0});
  EXPECT_NEAR(reading.tip_m.x, -0.001, 1e-5) << "the handle is twice as far from the port";
  step({0, 0, -0.01});
  EXPECT_NEAR(reading.tip_m.z, -0.01, 1e-9) << "along the shaft it goes with the hand";
  step({});
  // A wall at the tip's side that pushes it to the right.
  for (int k = 0; k < 800; ++k) {
    if (k % 16 == 0) answer({1, 0, 0}, 0.4f);
    step({});
  }
  HandState state;
  ASSERT_TRUE(hand.take_state(state));
  ASSERT_GT(state.model_force_n.x, 0.3);
  EXPECT_NEAR(device.last_force_n.x, -0.5 * state.model_force_n.x, 0.02) << "half, and mirrored";
  EXPECT_NEAR(device.last_force_n.z, 0, 0.02);
}

TEST_F(HandTest, ALostDeviceIsAnError) {
  device_.is_gone = true;
  EXPECT_FALSE(hand_.step(now_us_));
}

// A device whose readings are always new and go down by 5 mm, for the loop.
class LiveDevice : public FakeDevice {
 public:
  Result<device::DeviceReading> read() override {
    reading.time_us =
        static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::microseconds>(
                                       std::chrono::steady_clock::now().time_since_epoch())
                                       .count());
    reading.position_m.z = std::max(-0.005, reading.position_m.z - 5e-5);
    return FakeDevice::read();
  }
  Status write(const Vec3d& force_n, const Vec3d& torque_nm) override {
    if (length(force_n) > 0.02) is_pushed = true;
    return FakeDevice::write(force_n, torque_nm);
  }
  std::atomic<bool> is_pushed{false};
};

// The surface is where the tool starts.
void put_surface(Hand& hand) {
  wire::HapticPatch patch;
  patch.sequence = 1;
  patch.kind = wire::TouchKind::Near;
  hand.put(patch);
}

void wait_until(const std::function<bool()>& is_true) {
  for (int k = 0; k < 20'000 && !is_true(); ++k)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

TEST(Loop, StepsMeasuresAndEndsWithoutForce) {
  LiveDevice device;
  Hand hand(device, settings());
  put_surface(hand);
  Loop loop(hand, {.wants_real_time = false});
  const Loop::Granted granted = loop.start();
  EXPECT_FALSE(granted.has_priority);
  EXPECT_FALSE(granted.has_locked_memory);
  EXPECT_TRUE(loop.is_running());
  wait_until([&] { return device.reads >= 200 && device.is_pushed; });
  loop.stop();
  EXPECT_TRUE(device.is_pushed);
  EXPECT_FALSE(loop.is_running());
  EXPECT_FALSE(loop.failure());
  EXPECT_GE(device.reads, 200);
  EXPECT_EQ(device.writes, device.reads + 1) << "once more at the end";
  EXPECT_EQ(length(device.last_force_n), 0);
  LoopTiming timing;
  ASSERT_TRUE(loop.take_timing(timing));
  EXPECT_EQ(timing.steps, static_cast<std::uint64_t>(device.reads));
  EXPECT_GT(timing.late_99_us, 0);
  EXPECT_GE(timing.late_99_us, timing.late_median_us);
  EXPECT_GE(timing.late_worst_us, 0.9 * timing.late_99_us) << "its bin is 9 % wide";
}

// A hand that leans on tissue when the program ends would else be thrown forward.
TEST(Loop, AnEndTakesTheForceAwayNoFasterThanAHandBears) {
  class Recorder : public LiveDevice {
   public:
    Status write(const Vec3d& force_n, const Vec3d& torque_nm) override {
      const double step_n = length(force_n - last_force_n);
      largest_n = std::max(largest_n, length(force_n));
      largest_step_n = std::max(largest_step_n, step_n);
      return LiveDevice::write(force_n, torque_nm);
    }
    double largest_n = 0, largest_step_n = 0;
  };
  Recorder device;
  HandSettings firm = settings();
  firm.scale.force = 10;
  Hand hand(device, firm);
  put_surface(hand);
  Loop loop(hand, {.wants_real_time = false});
  loop.start();
  wait_until([&] {
    put_surface(hand);  // somebody answers
    return device.reads >= 500;
  });
  loop.stop();
  EXPECT_GT(device.largest_n, 1);
  // A step that is late may change the force by twice as much.
  EXPECT_LE(device.largest_step_n, 0.6 + 1e-9);
  EXPECT_EQ(length(device.last_force_n), 0);
}

TEST(Loop, RealTimeIsAskedForAndMayBeRefused) {
  LiveDevice device;
  Hand hand(device, settings());
  Loop loop(hand, {});
  loop.start();
  wait_until([&] { return device.reads >= 20; });
  EXPECT_TRUE(loop.is_running());
}

TEST(Loop, ADestructorEndsItWithoutForce) {
  LiveDevice device;
  Hand hand(device, settings());
  put_surface(hand);
  {
    Loop loop(hand, {.wants_real_time = false});
    loop.start();
    wait_until([&] { return device.is_pushed.load(); });
  }
  EXPECT_TRUE(device.is_pushed);
  const int writes = device.writes;
  EXPECT_EQ(writes, device.reads + 1);
  EXPECT_EQ(length(device.last_force_n), 0);
}

TEST(Loop, ALostDeviceEndsItWithAReason) {
  LiveDevice device;
  Hand hand(device, settings());
  Loop loop(hand, {.wants_real_time = false});
  loop.start();
  wait_until([&] { return device.reads >= 20; });
  device.is_gone = true;
  wait_until([&] { return !loop.is_running(); });
  ASSERT_FALSE(loop.is_running());
  loop.stop();
  ASSERT_TRUE(loop.failure());
  EXPECT_EQ(loop.failure()->message, "the device is gone");
  device.is_gone = false;
  loop.start();
  wait_until([&] { return device.reads >= 40; });
  EXPECT_TRUE(loop.is_running());
}

}  // namespace
}  // namespace trocar::haptics
