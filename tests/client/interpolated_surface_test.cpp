#include "client/replica/interpolated_surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <deque>
#include <random>

#include "common/base/timing.h"
#include "tests/client/synthetic_source.h"

namespace trocar::replica {
namespace {

constexpr std::uint64_t kMillisecond = 1'000'000;

// Arrivals with jitter; display at a rate of its own: never backwards, never beyond the newest
// frame, and settled near the wanted delay.
TEST(DisplayClock, IsMonotoneAndSettlesBehindTheNewestFrame) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    std::uniform_int_distribution<std::uint64_t> jitter(0, 6 * kMillisecond);
    DisplayClock clock;
    std::uint64_t next_arrival = 26 * kMillisecond;
    Tick tick = 0, newest = 0;
    double last = -1, delay_sum = 0;
    int delay_count = 0;
    for (std::uint64_t now = 0; now < 4000 * kMillisecond; now += 7 * kMillisecond) {
      while (next_arrival <= now) {
        tick += kTicksPerFrame;
        clock.add_arrival(tick, next_arrival);
        newest = tick;
        next_arrival = 10 * kMillisecond + (tick + kTicksPerFrame) * kMillisecond + jitter(random);
      }
      if (newest == 0) continue;
      const double shown = clock.advance(now);
      ASSERT_GE(shown, last) << "seed " << seed;
      ASSERT_LE(shown, static_cast<double>(newest)) << "seed " << seed;
      last = shown;
      if (now > 2000 * kMillisecond) {
        delay_sum += static_cast<double>(now) / kMillisecond - 10 - shown;
        ++delay_count;
      }
    }
    // A frame, and the jitter of nearly all frames.
    EXPECT_NEAR(clock.delay_ticks(), 16 + 6 + 1, 2) << "seed " << seed;
    EXPECT_NEAR(delay_sum / delay_count, clock.delay_ticks(), 2) << "seed " << seed;
  }
}

// Holds the delay after 5 s of a network, and how often the picture stood still.
struct Playout {
  double delay_ticks = 0, held_share = 0;
};
Playout play(DisplayClock& clock, std::uint64_t& now, int jitter_ms, double loss) {
  static std::mt19937 random(11);
  const std::uint64_t end = now + 5000 * kMillisecond;
  std::deque<std::pair<Tick, std::uint64_t>> under_way;
  int held = 0, shown = 0;
  Tick newest = 0;
  for (; now < end; now += kMillisecond) {
    const Tick tick = now / kMillisecond;
    if (tick % kTicksPerFrame == 0 && std::uniform_real_distribution<>(0, 1)(random) >= loss) {
      auto arrival = now + 10 * kMillisecond;
      arrival += static_cast<std::uint64_t>(std::uniform_int_distribution<>(0, jitter_ms)(random)) *
                 kMillisecond;
      if (!under_way.empty()) arrival = std::max(arrival, under_way.back().second);
      under_way.emplace_back(tick, arrival);
    }
    for (; !under_way.empty() && under_way.front().second <= now; under_way.pop_front())
      clock.add_arrival(newest = under_way.front().first, now);
    if (now % (5 * kMillisecond) != 0 || newest == 0) continue;
    const double tick_shown = clock.advance(now);
    if (now + 2000 * kMillisecond < end) continue;
    ++shown;
    held += tick_shown >= static_cast<double>(newest);
  }
  return {clock.delay_ticks(), static_cast<double>(held) / shown};
}

TEST(DisplayClock, ItsDelayIsWhatTheNetworkNeedsAndNoMore) {
  DisplayClock clock;
  std::uint64_t now = 1000 * kMillisecond;
  const auto calm = play(clock, now, 0, 0);
  EXPECT_EQ(calm.delay_ticks, kLeastDelayTicks);
  EXPECT_EQ(calm.held_share, 0);
  const auto rough = play(clock, now, 40, 0);
  EXPECT_GT(rough.delay_ticks, 40);
  EXPECT_LT(rough.held_share, 0.1);
  const auto lossy = play(clock, now, 2, 0.1);
  EXPECT_NEAR(lossy.delay_ticks, 2 * 16 + 2, 3) << "one frame in ten is missing";
  EXPECT_LT(lossy.held_share, 0.05);
  EXPECT_EQ(play(clock, now, 0, 0).delay_ticks, kLeastDelayTicks) << "it comes back";
  EXPECT_LE(play(clock, now, 900, 0).delay_ticks, kMostDelayTicks);
}

TEST(DisplayClock, FollowsASlowServerWithoutStopping) {
  DisplayClock clock;
  double last = -1;
  int stops = 0;
  Tick tick = 0;
  std::uint64_t arrival = 0;
  for (std::uint64_t now = 0; now < 6000 * kMillisecond; now += 10 * kMillisecond) {
    while (arrival <= now) {  // 16 ticks in 40 ms
      clock.add_arrival(tick += 16, arrival);
      arrival += 40 * kMillisecond;
    }
    const double shown = clock.advance(now);
    if (now > 2000 * kMillisecond && shown - last < 1e-6) ++stops;
    last = shown;
  }
  EXPECT_EQ(stops, 0);
}

TEST(DisplayClock, JumpsAfterASeekAndHoldsAtTheNewestFrame) {
  DisplayClock clock;
  clock.add_arrival(16, 0);
  EXPECT_EQ(clock.advance(kMillisecond), 16);
  clock.restart();
  clock.add_arrival(160'000, 5 * kMillisecond);
  EXPECT_EQ(clock.advance(6 * kMillisecond), 160'000);
  for (int i = 0; i < 100; ++i) EXPECT_LE(clock.advance((6 + 16 * i) * kMillisecond), 160'000);
}

TEST(InterpolatedSurface, LiesBetweenTheFramesOnEitherSide) {
  testing::SyntheticSource source(testing::make_blob_layout(12, 16, 0.08));
  Replica replica([&](const proto::Envelope& message) { return source.send(message); });
  InterpolatedSurface shown;
  source.queue_start();
  std::uint64_t now = monotonic_ns();
  shown.update(replica, now);
  EXPECT_FALSE(shown.is_valid());
  double last_tick = -1;
  for (int i = 0; i < 60; ++i) {
    source.queue_frame();
    source.poll(replica);
    for (int k = 0; k < 3; ++k) {
      shown.update(replica, now += 5 * kMillisecond);
      ASSERT_TRUE(shown.is_valid());
      ASSERT_GE(shown.tick(), last_tick);
      last_tick = shown.tick();
      ASSERT_LE(shown.tick(), static_cast<double>(replica.newest()->tick));
      const auto& history = replica.history();
      const auto after = std::ranges::find_if(
          history, [&](const auto& f) { return static_cast<double>(f.tick) >= shown.tick(); });
      ASSERT_NE(after, history.end());
      const auto before = after == history.begin() ? after : std::prev(after);
      for (std::size_t v = 0; v < shown.positions().size(); ++v) {
        const float rest = replica.topology().rest_positions[v].y;
        const float a = rest + wire::to_metres(before->surface[v]).y;
        const float b = rest + wire::to_metres(after->surface[v]).y;
        ASSERT_GE(shown.positions()[v].y, std::min(a, b) - 1e-6f);
        ASSERT_LE(shown.positions()[v].y, std::max(a, b) + 1e-6f);
      }
      ASSERT_EQ(shown.tools().size(), 2u);
      ASSERT_NEAR(norm(shown.tools()[0].world_from_tool.orientation), 1.0f, 1e-5f);
    }
  }
}

TEST(InterpolatedSurface, GlidesToTheTissueAfterAReturnToTheSession) {
  testing::SyntheticSource source(testing::make_blob_layout(12, 16, 0.08));
  float lift_m = 0;
  source.also_move = [&](std::size_t, const Vec3f&) { return Vec3f{0, lift_m, 0}; };
  Replica replica([&](const proto::Envelope& message) { return source.send(message); });
  InterpolatedSurface shown;
  std::uint64_t now = monotonic_ns();
  source.queue_start();
  source.queue_frame();
  source.poll(replica);
  shown.update(replica, now);
  const float before = shown.positions()[5].y;
  lift_m = 0.02f;  // much happened meanwhile
  source.queue_start();
  source.poll(replica);
  shown.update(replica, now += 5 * kMillisecond);
  EXPECT_EQ(shown.positions()[5].y, before) << "the last picture stays";
  source.queue_frame();
  source.poll(replica);
  float last = before;
  for (int i = 0; i < 80; ++i) {
    shown.update(replica, now += 5 * kMillisecond);
    EXPECT_LT(std::abs(shown.positions()[5].y - last), 0.001f) << "a jump in picture " << i;
    last = shown.positions()[5].y;
  }
  EXPECT_GT(last - before, 0.015f);
}

}  // namespace
}  // namespace trocar::replica
