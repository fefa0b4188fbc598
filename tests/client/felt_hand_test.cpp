// A hand between its device, the network's thread and the render thread; and what it reports.

#include "client/app/felt_hand.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <functional>
#include <thread>

#include "client/app/hands.h"
#include "common/base/timing.h"
#include "tests/client/live_device.h"

namespace trocar::app {
namespace {

using namespace std::chrono_literals;
using testing::LiveDevice;

struct Fixture {
  Fixture() {
    auto device_of_hand = std::make_unique<LiveDevice>();
    device = device_of_hand.get();
    hand = std::make_unique<FeltHand>(std::move(device_of_hand), FeltSettings{.scale = {2, 0.5}});
  }
  LiveDevice* device;
  std::unique_ptr<FeltHand> hand;
};

bool wait_until(const std::function<bool()>& is_true) {
  for (int k = 0; k < 10'000; ++k) {
    if (is_true()) return true;
    std::this_thread::sleep_for(1ms);
  }
  return false;
}

// Asks as a network does, every few milliseconds; when readings left.
std::vector<std::uint64_t> times_of_readings(FeltHand& hand, int asks) {
  std::vector<std::uint64_t> times;
  for (int i = 0; i < asks; ++i) {
    std::this_thread::sleep_for(3ms);
    const auto now = monotonic_ns();
    if (hand.pop_reading(now)) times.push_back(now);
  }
  return times;
}

TEST(FeltHand, BeforeTheStartThereIsNothingAndLawsAreKept) {
  Fixture fixture;
  wire::HapticLaw law;
  for (std::uint32_t i = 1; i <= 20; ++i) {  // more than any model keeps
    law.number = i;
    fixture.hand->take(law);
  }
  wire::HapticPatch patch;
  patch.force_n = {9, 0, 0};
  fixture.hand->take(patch);
  EXPECT_FALSE(fixture.hand->pop_reading(monotonic_ns()));
  EXPECT_FALSE(fixture.hand->pop_report());
  ASSERT_TRUE(fixture.hand->start({}).ok());
  ASSERT_TRUE(wait_until([&] { return fixture.hand->pop_reading(monotonic_ns()).has_value(); }));
  EXPECT_EQ(fixture.hand->figures().state.largest_server_force_n, 0) << "patches are dropped";
}

TEST(FeltHand, SaysThatReadingsAreTooOldAndTakesItBack) {
  Fixture fixture;
  ASSERT_TRUE(fixture.hand->start({}).ok());
  fixture.device->is_stuck = true;
  const auto has_old = [&] {
    EXPECT_TRUE(fixture.hand->check().ok());
    return fixture.hand->has_old_readings();
  };
  EXPECT_TRUE(wait_until(has_old));
  fixture.device->is_stuck = false;
  EXPECT_TRUE(wait_until([&] { return !has_old(); }));
}

TEST(FeltHand, AnAnswerReachesTheLoopWithoutTheRenderThread) {
  Fixture fixture;
  ASSERT_TRUE(fixture.hand->start({0, 0, 0.1}).ok());
  wire::HapticPatch patch;
  patch.kind = wire::TouchKind::Push;
  patch.force_n = {0, 0, 0.5f};
  ASSERT_TRUE(wait_until([&] {
    ++patch.sequence;
    fixture.hand->take(patch);
    return fixture.hand->figures().state.patches.patches >= 3;
  }));
  EXPECT_EQ(fixture.hand->figures().state.server_force_n, (Vec3d{0, 0, 0.5}));
}

TEST(FeltHand, AHandThatMovesSpeaksAtOnceAndOneThatRestsNowAndThen) {
  Fixture fixture;
  fixture.device->moves = true;
  ASSERT_TRUE(fixture.hand->start({}).ok());
  const auto moving = times_of_readings(*fixture.hand, 100);
  EXPECT_GT(moving.size(), 50u) << "only where it turns round it goes less than 60 um";
  fixture.device->moves = false;
  const auto stopping = times_of_readings(*fixture.hand, 10);
  const auto resting = times_of_readings(*fixture.hand, 100);
  EXPECT_GE(resting.size(), 5u);
  for (std::size_t i = 1; i < resting.size(); ++i)
    EXPECT_GE(resting[i] - resting[i - 1], 20'000'000u);
  std::size_t sent = 0;
  while (fixture.hand->pop_sent()) ++sent;
  EXPECT_EQ(sent, moving.size() + stopping.size() + resting.size());
  EXPECT_EQ(fixture.hand->figures().readings_sent, sent);
}

TEST(FeltHand, MovesAsItsToolIsSeen) {
  Fixture fixture;
  fixture.hand->set_view({0, std::sqrt(0.5f), 0, std::sqrt(0.5f)});  // right is -z of the world
  fixture.device->moves = true;
  ASSERT_TRUE(fixture.hand->start({}).ok());
  Vec3d least, most;
  ASSERT_TRUE(wait_until([&] {
    const auto reading = fixture.hand->pop_reading(monotonic_ns());
    if (!reading) return false;
    least = {std::min(least.x, reading->tip_m.x), 0, std::min(least.z, reading->tip_m.z)};
    most = {std::max(most.x, reading->tip_m.x), 0, std::max(most.z, reading->tip_m.z)};
    return most.z - least.z > 0.015;  // of 20 mm
  }));
  EXPECT_LT(most.x - least.x, 1e-4);
}

// ---- reports ----

haptics::HandState state_at(std::uint64_t time_us) {
  haptics::HandState state;
  state.time_us = time_us;
  state.steps = time_us / 1000;
  state.hand_force_in_world_n = {0, 1e-6 * static_cast<double>(time_us), 0};
  state.model_force_n = {1, 2, 3};
  state.patch_age_s = 0.007;
  state.answer_s = 0.045;
  return state;
}

TEST(HandReporter, KeepsAMomentEverySixteenMillisecondsAndGivesEightAtOnce) {
  HandReporter reporter("calculated hand", {2, 0.5});
  std::vector<wire::HandReport> reports;
  for (std::uint64_t us = 1'000'000; us < 2'000'000; us += 4000) {
    auto state = state_at(us);
    // A safeguard acts in one step between two moments.
    state.limit_counts[6] = us >= 1'150'000;
    if (auto report = reporter.add(state)) reports.push_back(std::move(*report));
  }
  ASSERT_EQ(reports.size(), 7u);
  std::uint64_t last_us = 0, slews = 0;
  for (const auto& report : reports) {
    ASSERT_EQ(report.moments.size(), wire::HandReport::kMostMoments);
    for (const auto& moment : report.moments) {
      if (last_us != 0) {
        EXPECT_EQ(moment.time_us - last_us, 16'000u);
      }
      last_us = moment.time_us;
      EXPECT_NEAR(moment.hand_force_n.y, 1e-6 * static_cast<double>(moment.time_us), 1e-6);
      EXPECT_EQ(moment.model_force_n, (Vec3f{1, 2, 3}));
      EXPECT_EQ(moment.answer_age_us, 7000u);
      slews += moment.limits == 1u << 6;
    }
    EXPECT_NEAR(report.rate_hz, 1000, 1);
    EXPECT_NEAR(report.echo_delay_s, 0.045f, 1e-6f);
    EXPECT_EQ(report.motion_scale, 2);
    EXPECT_EQ(report.force_scale, 0.5f);
  }
  EXPECT_EQ(slews, 1u) << "told once";
  EXPECT_EQ(reports[0].device, "calculated hand");
  EXPECT_EQ(reports[1].device, "") << "the name comes now and then";
}

TEST(HandReporter, APauseEndsAReport) {
  HandReporter reporter("calculated hand", {});
  for (std::uint64_t us = 1'000'000; us < 1'050'000; us += 4000)
    EXPECT_FALSE(reporter.add(state_at(us)));
  const auto report = reporter.add(state_at(9'000'000));
  ASSERT_TRUE(report);
  EXPECT_EQ(report->moments.size(), 4u);
  EXPECT_EQ(report->moments.back().time_us, 1'048'000u);
  for (std::uint64_t us = 9'016'000; us < 9'112'000; us += 16'000)
    EXPECT_FALSE(reporter.add(state_at(us)));
  const auto next = reporter.add(state_at(9'112'000));
  ASSERT_TRUE(next);
  EXPECT_EQ(next->moments.front().time_us, 9'000'000u);
  EXPECT_NEAR(next->rate_hz, 1000, 1) << "of the time after the pause";
}

}  // namespace
}  // namespace trocar::app
