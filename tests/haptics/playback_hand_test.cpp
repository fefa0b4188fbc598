// A recorded force on a learner's hand: felt while the recording plays at its own speed, and never
// else.

#include "client/haptics/playback_hand.h"

#include <gtest/gtest.h>

#include <cmath>

#include "client/device/hand_script.h"
#include "client/device/simulated_device.h"
#include "tests/haptics/fake_device.h"

namespace trocar::haptics {
namespace {

using testing::FakeDevice;

// Ten seconds: the tip goes along x at 10 mm/s, and feels 0.2 N along y, and 0.1 N/s along z.
replay::RecordedHand recorded() {
  replay::RecordedHand hand;
  hand.name = "Mira";
  for (Tick tick = 0; tick <= 10'000; tick += 16) {
    const auto seconds = 1e-3f * static_cast<float>(tick);
    hand.felt.push_back({tick, {0.01f * seconds, 0, 0}, {0, 0.2f, 0.1f * seconds}, {}});
  }
  return hand;
}

class Playback : public ::testing::Test {
 protected:
  explicit Playback(PlaybackSettings settings = {.pull_n_m = 0})
      : hand_(device_, recorded(), settings) {}

  // Milliseconds of the loop, with news from the player every fourth.
  void run(int milliseconds) {
    for (int k = 0; k < milliseconds; ++k) {
      now_us_ += 1000;
      if (is_playing_) tick_ += speed_;
      if (now_us_ % 4000 == 0 && is_heard_)
        hand_.put({.tick = tick_, .time_us = now_us_, .is_running = is_playing_ && speed_ == 1});
      device_.reading.time_us = now_us_;
      const Vec3d before_n = device_.last_force_n;
      ASSERT_TRUE(hand_.step(now_us_));
      largest_step_n_ = std::max(largest_step_n_, length(device_.last_force_n - before_n));
    }
  }
  void expect_felt(double share = 1) {
    EXPECT_NEAR(device_.last_force_n.y, share * 0.2, 0.004);
    EXPECT_NEAR(device_.last_force_n.z, share * 0.1e-3 * tick_, 0.004);
  }
  void expect_nothing() { EXPECT_EQ(length(device_.last_force_n), 0); }

  FakeDevice device_;
  PlaybackHand hand_;
  std::uint64_t now_us_ = 1'000'000;
  double tick_ = 1000, speed_ = 1, largest_step_n_ = 0;
  bool is_playing_ = true, is_heard_ = true;
};

TEST_F(Playback, TheForceOfTheMomentIsFelt) {
  run(500);
  expect_felt();
  run(3000);
  expect_felt();
  EXPECT_LE(largest_step_n_, 0.01) << "it begins little by little";
}

TEST_F(Playback, AnEndTakesTheForceAwayNoFasterThanAHandBears) {
  tick_ = 5000;
  run(1000);
  ASSERT_GT(length(device_.last_force_n), 0.5);
  EXPECT_FALSE(hand_.let_go());
  largest_step_n_ = 0;
  for (int k = 0; k < 10 && !hand_.let_go(); ++k) run(1);
  EXPECT_TRUE(hand_.let_go());
  EXPECT_LE(largest_step_n_, 0.3 + 1e-9);
  expect_nothing();
}

TEST_F(Playback, NothingIsFeltWhileItStandsOrPlaysAtAnotherSpeed) {
  run(1000);
  is_playing_ = false;
  run(100);
  expect_nothing();
  is_playing_ = true;
  speed_ = 2;
  run(500);
  expect_nothing();
  speed_ = 0.5;
  run(500);
  expect_nothing();
  speed_ = 1;
  run(10);
  EXPECT_LT(length(device_.last_force_n), 0.05) << "it comes back little by little";
  run(500);
  expect_felt();
}

TEST_F(Playback, ASeekFadesOutAndIn) {
  run(1000);
  const double before_n = length(device_.last_force_n);
  tick_ = 8000;
  largest_step_n_ = 0;
  double least_n = before_n;
  for (int k = 0; k < 120; ++k) {
    run(1);
    least_n = std::min(least_n, length(device_.last_force_n));
  }
  EXPECT_EQ(least_n, 0);
  run(500);
  expect_felt();
  EXPECT_LE(largest_step_n_, 0.02);
}

TEST_F(Playback, NothingIsFeltBeyondTheRecordingOrWithoutNews) {
  tick_ = 9800;
  run(500);
  expect_nothing();
  tick_ = 1000;
  run(1000);
  expect_felt();
  is_heard_ = false;
  run(400);
  expect_nothing();
}

TEST_F(Playback, ItKeepsTheSafetyChain) {
  run(1000);
  device_.reading.position_m.x = 0.2;
  run(1);
  expect_nothing();
  run(600);
  expect_felt();
  EXPECT_EQ(device_.writes, device_.reads);
  hand_.stop();
  expect_nothing();
}

class LedPlayback : public Playback {
 protected:
  LedPlayback() : Playback({.scale = {.motion = 2, .force = 1}, .pull_n_m = 50}) {}
};

TEST_F(LedPlayback, AWeakSpringPullsAlongTheWay) {
  run(1000);
  // The device stays. The recording began at 1 s; twice as far in the scene.
  const double way_m = 0.01 * 1e-3 * (tick_ - 1000) / 2;
  EXPECT_NEAR(device_.last_force_n.x, 50 * way_m, 0.01);
  expect_felt();
  run(7000);
  EXPECT_NEAR(device_.last_force_n.x, 1, 0.01) << "no more than 1 N";
}

TEST_F(LedPlayback, AfterAPauseTheWayBeginsWhereTheHandIs) {
  run(2000);
  is_playing_ = false;
  run(200);
  is_playing_ = true;
  run(300);
  EXPECT_LT(device_.last_force_n.x, 0.1);
}

TEST_F(LedPlayback, TheClutchLetsGo) {
  run(1000);
  device_.reading.buttons = 1;
  run(100);
  expect_nothing();
}

// The calculated hand wants to stay: it is drawn along as far as its arm yields, and pushed by the
// force as an arm is.
TEST(LedHand, ACalculatedHandIsDrawnAndPushed) {
  std::uint64_t now_us = 1'000'000;
  device::SimulatedDevice device(*device::HandScript::parse("still"), [&] { return now_us; });
  PlaybackHand hand(device, recorded(), {.pull_n_m = 80});
  for (int k = 0; k < 4000; ++k) {
    now_us += 1000;
    hand.put({.tick = 1e-3 * static_cast<double>(now_us - 1'000'000),
              .time_us = now_us,
              .is_running = true});
    ASSERT_TRUE(hand.step(now_us));
  }
  const auto place = device.read()->position_m;
  HandState state;
  ASSERT_TRUE(hand.take_state(state));
  // An arm of 400 N/m and a reflex of 80 N/m; the expert is 40 mm away, so the spring is at 1 N.
  EXPECT_NEAR(place.x, 1.0 / 480, 3e-4);
  EXPECT_NEAR(place.z, 0.1 * 4 / 480, 1e-4);
  EXPECT_NEAR(state.model_force_n.z, 0.4, 0.01);
  EXPECT_EQ(state.steps, 4000u);
}

}  // namespace
}  // namespace trocar::haptics
