#include <gtest/gtest.h>

#include <thread>

#include "client/haptics/local_events.h"
#include "client/haptics/past_states.h"
#include "client/haptics/reading_pace.h"
#include "client/haptics/slope_fit.h"
#include "client/haptics/wake_statistics.h"
#include "common/base/newest.h"

namespace trocar::haptics {
namespace {

TEST(SlopeFit, FindsTheSlopeOfAnAffineRelation) {
  SlopeFit fit(0.5, 0.01);
  for (int k = 0; k < 200; ++k) {
    const double local_n = 0.3 + 0.2 * std::sin(0.2 * k);
    fit.add({1.4 * local_n + 0.1, 0, 0}, {local_n, 0, 0}, 0.016, 0.7);
  }
  // A ratio would be 1.4 + 0.1 / 0.3.
  EXPECT_NEAR(fit.slope(), 1.4, 0.02);
}

TEST(SlopeFit, BelievesThePriorWhileNothingVaries) {
  SlopeFit fit(0.5, 0.01);
  for (int k = 0; k < 100; ++k) fit.add({0.5, 0, 0}, {0.3, 0, 0}, 0.016, 0.8);
  EXPECT_NEAR(fit.slope(), 0.8, 1e-3);
}

TEST(SlopeFit, StaysWhereItIsWithoutForceOrPrior) {
  SlopeFit fit(0.5, 0.01);
  fit.set_slope(1.2);
  for (int k = 0; k < 100; ++k) fit.add({0.5, 0, 0}, {0.3, 0, 0}, 0.016, std::nullopt);
  EXPECT_NEAR(fit.slope(), 1.2, 1e-9);
  for (int k = 0; k < 100; ++k) fit.add({0.5, 0, 0}, {0.005, 0, 0}, 0.016, 3);
  EXPECT_NEAR(fit.slope(), 1.2, 1e-9);
}

TEST(SlopeFit, FindsALean) {
  SlopeFit fit(0.5, 0.01);
  // The force across grows by 0.1 of that along the normal, around a constant that is no lean.
  for (int k = 0; k < 200; ++k) {
    const double local_n = 0.3 + 0.2 * std::sin(0.2 * k);
    fit.add({1.3 * local_n, 0, 0}, {local_n, 0, 0}, 0.016, std::nullopt);
    fit.add_lean({0, 0.05 - 0.1 * local_n, 0.04 * local_n}, local_n);
  }
  EXPECT_NEAR(fit.lean().y, -0.1, 0.005);
  EXPECT_NEAR(fit.lean().z, 0.04, 0.005);
  for (int k = 0; k < 200; ++k) {
    const double local_n = 0.3 + 0.2 * std::sin(0.2 * k);
    fit.add({1.3 * local_n, 0, 0}, {local_n, 0, 0}, 0.016, std::nullopt);
    fit.add_lean({0, 0, 9 * local_n}, local_n);
  }
  EXPECT_LE(length(fit.lean()), SlopeFit::kMostLean * fit.slope() + 1e-12);
  fit.clear_sums();
  EXPECT_EQ(fit.lean(), Vec3d{});
}

TEST(SlopeFit, IsBounded) {
  SlopeFit fit(0.5, 0.01);
  for (int k = 0; k < 100; ++k) fit.add({9, 0, 0}, {0.3, 0, 0}, 0.016, 30);
  EXPECT_EQ(fit.slope(), SlopeFit::kMost);
  for (int k = 0; k < 100; ++k) fit.add({}, {0.3, 0, 0}, 0.016, 0);
  EXPECT_EQ(fit.slope(), SlopeFit::kLeast);
  fit.restart({}, {0.3, 0, 0});
  EXPECT_EQ(fit.slope(), SlopeFit::kLeast);
  fit.restart({0.15, 0, 0}, {0.3, 0, 0});
  EXPECT_NEAR(fit.slope(), 0.5, 1e-12);
}

TEST(PastStates, AreInterpolatedAndForgotten) {
  PastStates past;
  EXPECT_FALSE(past.at(1000));
  for (std::uint64_t k = 1; k <= PastStates::kCapacity + 100; ++k) {
    PastState state;
    state.time_us = k * 1000;
    state.depth_m = static_cast<double>(k);
    past.add(state);
  }
  EXPECT_FALSE(past.at(100'000));
  EXPECT_NEAR(past.at(101'000)->depth_m, 101, 1e-12);
  EXPECT_NEAR(past.at(2'000'250)->depth_m, 2000.25, 1e-9);
  EXPECT_NEAR(past.at(99'000'000)->depth_m, PastStates::kCapacity + 100, 1e-12);
}

TEST(LocalStop, IsAStiffDampedSpringFromWhereItBegan) {
  LocalStop stop;
  stop.begin({0, 0, -0.005}, {0, 0, 1}, 0.005, 0.3, 1000);
  constexpr double kLong_s = 0.1;
  EXPECT_NEAR(stop.step({0, 0, -0.005}, {0, 0, -0.05}, 1e-9), 0.3, 1e-6) << "begins undamped";
  EXPECT_NEAR(stop.step({0, 0, -0.005}, {}, kLong_s), 0.3, 1e-12);
  EXPECT_NEAR(stop.step({0.01, 0, -0.0052}, {}, kLong_s), 0.5, 1e-12);
  EXPECT_NEAR(stop.step({0, 0, -0.0052}, {0, 0, -0.05}, kLong_s), 0.6, 1e-12);
  EXPECT_EQ(stop.step({0, 0, 0.001}, {}, kLong_s), 0) << "above the surface";
  EXPECT_EQ(stop.step({0, 0, -0.003}, {}, kLong_s), 0) << "it does not pull";
}

TEST(Newest, GivesTheNewestOnce) {
  Newest<int> newest;
  int value = 7;
  EXPECT_FALSE(newest.take(value));
  EXPECT_EQ(value, 7);
  for (int k = 1; k <= 5; ++k) newest.put(k);
  EXPECT_TRUE(newest.take(value));
  EXPECT_EQ(value, 5);
  EXPECT_FALSE(newest.take(value));
}

TEST(Newest, IsWholeBetweenThreads) {
  struct Many {
    std::array<std::uint64_t, 32> words{};
  };
  constexpr std::uint64_t kLast = 200'000;
  Newest<Many> newest;
  std::jthread writer([&] {
    Many many;
    for (std::uint64_t k = 1; k <= kLast; ++k) {
      many.words.fill(k);
      newest.put(many);
    }
  });
  std::uint64_t last = 0;
  while (last < kLast) {
    Many many;
    if (!newest.take(many)) continue;
    ASSERT_GT(many.words[0], last);
    last = many.words[0];
    for (const auto word : many.words) ASSERT_EQ(word, last);
  }
}

TEST(WakeStatistics, QuantilesAreWithinABin) {
  WakeStatistics late;
  EXPECT_EQ(late.quantile_us(0.5), 0);
  for (int k = 1; k <= 1000; ++k) late.add(k);
  EXPECT_NEAR(late.quantile_us(0.5) / 500, 1.05, 0.06);
  EXPECT_NEAR(late.quantile_us(0.99) / 990, 1.05, 0.06);
  EXPECT_EQ(late.count(), 1000u);
}

// A second of a hand that goes at this speed, and turns its verb in the end: how often it is sent,
// and how far it is from where it was sent.
struct Paced {
  int count = 0;
  double worst_m = 0;
};
Paced pace_for(double speed_m_s) {
  HandReading sent;
  std::uint64_t sent_ms = 0;
  Paced paced{1};
  for (std::uint64_t ms = 1; ms <= 1000; ++ms) {
    HandReading reading;
    reading.tip_m.x = speed_m_s * 1e-3 * static_cast<double>(ms);
    if (is_due(reading, sent, (ms - sent_ms) * 1'000'000)) {
      sent = reading;
      sent_ms = ms;
      ++paced.count;
    }
    paced.worst_m = std::max(paced.worst_m, length(reading.tip_m - sent.tip_m));
  }
  return paced;
}

TEST(ReadingPace, AHandAtRestSaysSoAndAQuickOneAsOftenAsItMay) {
  EXPECT_EQ(pace_for(0).count, 51) << "every 20 ms";
  EXPECT_EQ(pace_for(0.1).count, 251) << "every 4 ms";
  const auto slow = pace_for(0.0055);
  EXPECT_EQ(slow.count, 91) << "as often as it has gone 60 um: every 11 ms";
  EXPECT_LE(slow.worst_m, 60e-6);
  EXPECT_LE(pace_for(0.0001).worst_m, 2.1e-6);
}

TEST(ReadingPace, AnotherVerbOrDirectionIsNotKeptBack) {
  HandReading sent, other;
  other.verb = tool::Verb::Grasp;
  EXPECT_TRUE(is_due(other, sent, 1'000'000));
  HandReading turned;
  turned.orientation = normalized(Quatf{0, 0.01f, 0, 1});
  EXPECT_FALSE(is_due(turned, sent, 1'000'000));
  EXPECT_TRUE(is_due(turned, sent, 4'000'000));
  EXPECT_FALSE(is_due(sent, sent, 4'000'000));
}

}  // namespace
}  // namespace trocar::haptics
