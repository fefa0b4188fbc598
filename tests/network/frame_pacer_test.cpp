// The pacer against a model of a link: a rate, a delay, a queue, losses. Time is the test's.

#include "server/session/pacing/frame_pacer.h"

#include <gtest/gtest.h>

#include <deque>
#include <random>

namespace trocar::pacing {
namespace {

constexpr std::uint64_t kMs = 1'000'000, kFrameNs = 16 * kMs;

struct Link {
  std::uint64_t one_way_ns = 0;
  std::uint64_t per_frame_ns = 0;  // that the link needs for one
  double loss = 0;
};

struct Outcome {
  std::uint64_t oldest_ns = 0;  // age of a frame on arrival, in the second half
  int arrived = 0;
};

Outcome run(const Link& link, double seconds) {
  struct Flight {
    Frame frame;
    std::uint64_t sent_ns, acknowledged_ns;
  };
  FramePacer pacer;
  std::mt19937 random(3);
  std::deque<Flight> flights;
  std::uint64_t free_ns = 0;
  Outcome outcome;
  const auto end = static_cast<std::uint64_t>(seconds * 1e9);
  Frame frame = 1;
  for (std::uint64_t now = kFrameNs; now < end; now += kMs) {
    while (!flights.empty() && flights.front().acknowledged_ns <= now) {
      const auto flight = flights.front();
      flights.pop_front();
      pacer.on_acknowledged(flight.frame, now);
      if (now < end / 2) continue;
      ++outcome.arrived;
      outcome.oldest_ns =
          std::max(outcome.oldest_ns, flight.acknowledged_ns - link.one_way_ns - flight.sent_ns);
    }
    if (now % kFrameNs != 0) continue;
    ++frame;
    if (!pacer.may_send(now)) continue;
    pacer.on_sent(frame, now);
    free_ns = std::max(free_ns, now) + link.per_frame_ns;
    const bool is_lost = std::uniform_real_distribution<>(0, 1)(random) < link.loss;
    if (!is_lost) flights.push_back({frame, now, free_ns + 2 * link.one_way_ns});
  }
  return outcome;
}

TEST(FramePacer, a_link_that_keeps_up_gets_every_frame) {
  for (const std::uint64_t one_way_ms : {1u, 10u, 30u, 75u}) {
    const auto outcome = run({one_way_ms * kMs, 2 * kMs, 0}, 20);
    EXPECT_GT(outcome.arrived, 620) << one_way_ms << " ms: of 625 frames";
    EXPECT_LE(outcome.oldest_ns, (one_way_ms + 4) * kMs);
  }
}

TEST(FramePacer, a_slow_link_gets_fewer_and_they_stay_young) {
  for (const std::uint64_t per_frame_ms : {20u, 40u, 100u, 300u}) {
    const auto outcome = run({10 * kMs, per_frame_ms * kMs, 0}, 400);
    EXPECT_GT(outcome.arrived, 120'000 / static_cast<int>(per_frame_ms)) << per_frame_ms;
    // A frame waits for the one before it at most, and for what was early enough before.
    EXPECT_LE(outcome.oldest_ns, (10 + 2 * per_frame_ms + 80) * kMs) << per_frame_ms;
  }
}

TEST(FramePacer, losses_neither_stop_nor_slow_it) {
  const auto outcome = run({30 * kMs, 2 * kMs, 0.2}, 20);
  EXPECT_GT(outcome.arrived, 450) << "of 625, a fifth of them lost";
}

TEST(FramePacer, is_congested_when_one_frame_at_a_time_is_late_and_most_are_lost) {
  const auto end = [](std::uint64_t late_ms, bool has_losses) {
    FramePacer pacer;
    std::uint64_t now = 1000 * kMs;
    for (Frame frame = 1; frame < 100; ++frame) {
      pacer.on_sent(frame, now);
      now += (frame < 10 ? 20 : 20 + late_ms) * kMs;
      if (!has_losses || frame % 4 == 0) pacer.on_acknowledged(frame, now);
    }
    EXPECT_EQ(pacer.is_congested(now), late_ms > 60 && has_losses);
    pacer.restart();
    EXPECT_FALSE(pacer.is_congested(now));
    return pacer.window();
  };
  for (const std::uint64_t late_ms : {0u, 20u, 90u})
    for (const bool has_losses : {false, true}) EXPECT_GE(end(late_ms, has_losses), 1);
}

TEST(FramePacer, is_congested_when_of_many_frames_none_arrives) {
  FramePacer pacer;
  for (Frame frame = 1; frame <= 10; ++frame) pacer.on_sent(frame, frame * kFrameNs);
  EXPECT_FALSE(pacer.is_congested(10 * kFrameNs));
  EXPECT_TRUE(pacer.is_congested(600 * kMs));
  pacer.on_acknowledged(10, 600 * kMs);
  EXPECT_FALSE(pacer.is_congested(600 * kMs));
}

TEST(FramePacer, after_silence_one_frame_tries_again) {
  FramePacer pacer;
  std::uint64_t now = 1000 * kMs;
  Frame frame = 0;
  while (pacer.may_send(now)) pacer.on_sent(++frame, now);
  EXPECT_EQ(frame, static_cast<Frame>(FramePacer::kFirstFrames));
  now += 1000 * kMs;
  ASSERT_TRUE(pacer.may_send(now));
  pacer.on_sent(++frame, now);
  EXPECT_FALSE(pacer.may_send(now + kFrameNs));
  pacer.on_acknowledged(frame, now + kFrameNs);
  EXPECT_EQ(pacer.under_way(), 0u);
  pacer.on_acknowledged(frame + 1, now);  // never sent
  EXPECT_EQ(pacer.under_way(), 0u);
}

}  // namespace
}  // namespace trocar::pacing
