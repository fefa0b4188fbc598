// The controller on a virtual clock with injected costs: what is kept, what is given up in which
// order, and that it neither oscillates nor forgets to come back.

#include "server/session/control/rate_controller.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/tissue/step/simulation.h"
#include "tests/control/virtual_machine.h"

namespace trocar::control {
namespace {

using testing::direction_changes;
using testing::kept_share;
using testing::Load;
using testing::Machine;
using testing::roomy_limits;
using testing::Row;
using testing::run_virtual;
using wire::RateLevel;

const step::LayerCounts kAll{4, 4, 4, 4}, kLeast{2, 1, 1, 1};

// These rules must hold in every run, whatever happens.
void expect_rules(const std::vector<Row>& rows, const RateLimits& limits) {
  int since_change = 1000;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto& row = rows[i];
    ASSERT_TRUE(step::validate(row.decisions).ok()) << row.tick;
    ASSERT_GE(row.sweeps[0], limits.touched_sweeps);
    ASSERT_GE(row.sweeps[3], limits.layer_sweeps);
    ASSERT_GE(row.node_limit, limits.nodes);
    for (std::size_t layer = 0; layer < step::kSweepLayers; ++layer) {
      ASSERT_LE(row.sweeps[layer], limits.highest.sweeps);
      // A layer loses a sweep only when the deeper ones have nothing left to lose.
      if (layer > 0 && row.sweeps[layer - 1] < limits.highest.sweeps) {
        ASSERT_EQ(row.sweeps[layer], limits.layer_sweeps) << row.tick;
      }
    }
    if (row.node_limit < limits.highest.node_limit) {
      ASSERT_EQ(row.sweeps, kLeast) << row.tick << ": nodes go last";
    }
    if (i == 0) continue;
    ++since_change;
    if (row.decisions == rows[i - 1].decisions) continue;
    int steps = 0;
    for (std::size_t layer = 0; layer < step::kSweepLayers; ++layer)
      if (rows[i - 1].layer_nodes[layer] > 0)
        steps += std::abs(static_cast<int>(row.sweeps[layer]) -
                          static_cast<int>(rows[i - 1].sweeps[layer]));
    ASSERT_LE(steps, 1) << row.tick << ": one sweep of one layer at a time";
    ASSERT_GE(since_change, RateController::kLowerEvery) << row.tick;
    since_change = 0;
  }
}

TEST(RateController, WithRoomItDecidesWhatWasAskedFor) {
  const auto limits = roomy_limits();
  const auto rows = run_virtual({}, {}, 3000, limits);
  for (const auto& row : rows) {
    ASSERT_EQ(row.decisions, limits.highest);
    ASSERT_EQ(row.level, RateLevel::Full);
  }
  EXPECT_EQ(rows.back().slow_ticks, 0u);
}

TEST(RateController, ASpikeChangesNothing) {
  const auto limits = roomy_limits();
  const Load load{.contacts = [](Tick) { return 5; },
                  .spike_us = [](Tick tick) { return tick == 1000 ? 9000.0 : 0.0; }};
  const auto rows = run_virtual({}, load, 3000, limits);
  for (const auto& row : rows) ASSERT_EQ(row.decisions, limits.highest) << row.tick;
}

// Nakao 2003 fig. 16: at 6 layers most cycles take 4 to 6 ms and some of them up to 13.7 ms, for
// reasons outside (topology, the operating system). Scaled to our tick: 0.42 ms, spikes up to 2.2.
TEST(RateController, PeriodicSpikesAreSatOut) {
  const auto limits = roomy_limits();
  const Load load{
      .contacts = [](Tick) { return 5; },
      .spike_us =
          [](Tick tick) { return tick % 40 == 7 ? 1700.0 : (tick % 40 == 21 ? 700.0 : 0.0); }};
  const auto rows = run_virtual({}, load, 10'000, limits);
  expect_rules(rows, limits);
  for (const auto& row : rows) ASSERT_EQ(row.decisions, limits.highest) << row.tick;
  EXPECT_GE(kept_share(rows, 0, 10'000), 0.94);
  EXPECT_LE(rows.back().slow_ticks, 250u) << "at most the spike's own second tick";
}

// The same spikes where the tick is tight: it is the regular part that is brought into the budget.
TEST(RateController, WithSpikesTheRegularPartKeepsItsBudget) {
  Machine machine;
  machine.per_sweep_us = 0.07;
  const Load load{.contacts = [](Tick) { return 5; },
                  .spike_us = [](Tick tick) { return tick % 16 == 7 ? 2500.0 : 0.0; }};
  const auto limits = roomy_limits();
  const auto with = run_virtual(machine, load, 20'000, limits);
  const auto without = run_virtual(machine, load, 20'000, limits, false);
  expect_rules(with, limits);
  EXPECT_LT(kept_share(without, 2000, 20'000), 0.05);
  EXPECT_GT(kept_share(with, 2000, 20'000), 0.93);  // 15 of 16
  EXPECT_LT(with.back().slow_ticks, without.back().slow_ticks / 3);
  EXPECT_LE(direction_changes(with, 0, 20'000), 4);
}

// A quarter of the ticks are spikes: the median says that all is well, the clock that it is not.
TEST(RateController, SpikesThatAreTooManyForTheClockMakeRoomForThemselves) {
  Machine machine;
  machine.per_sweep_us = 0.044;
  const Load load{
      .contacts = [](Tick) { return 5; },
      .spike_us = [](Tick tick) { return tick < 15'000 && tick % 4 == 1 ? 1300.0 : 0.0; }};
  const auto limits = roomy_limits();
  const auto with = run_virtual(machine, load, 30'000, limits);
  const auto without = run_virtual(machine, load, 30'000, limits, false);
  expect_rules(with, limits);
  EXPECT_GT(without.back().slow_ticks, 500u);
  EXPECT_LT(with.back().slow_ticks, without.back().slow_ticks / 3);
  EXPECT_EQ(with.back().decisions, limits.highest) << "they are over";
  EXPECT_LE(direction_changes(with, 0, 30'000), 12);
}

TEST(RateController, AMachineThatGetsTwiceAsSlowInTenSecondsIsFollowedDownAndUp) {
  Machine machine;
  machine.per_sweep_us = 0.032;
  // Slower from 5 s to 15 s, quicker again from 25 s to 35 s.
  const Load load{.contacts = [](Tick) { return 6; },
                  .slowness =
                      [](Tick tick) {
                        const double t = static_cast<double>(tick) * 1e-3;
                        return 1 + std::clamp((t - 5) / 10, 0.0, 1.0) -
                               std::clamp((t - 25) / 10, 0.0, 1.0);
                      }};
  const auto limits = roomy_limits();
  const auto rows = run_virtual(machine, load, 45'000, limits);
  const auto without = run_virtual(machine, load, 45'000, limits, false);
  expect_rules(rows, limits);
  EXPECT_EQ(rows[4000].sweeps, kAll);
  EXPECT_GT(kept_share(rows, 0, 45'000), 0.999);
  EXPECT_EQ(rows.back().slow_ticks, 0u);
  EXPECT_GT(without.back().slow_ticks, 1000u);
  EXPECT_LT(testing::amount(rows[24'000]), testing::amount(rows[4000]));
  EXPECT_EQ(rows.back().decisions, limits.highest) << "it comes back";
  EXPECT_LE(direction_changes(rows, 0, 45'000), 3);
}

TEST(RateController, AStalledSecondIsCountedAndChangesNothing) {
  const auto limits = roomy_limits();
  const Load load{.contacts = [](Tick) { return 6; },
                  .spike_us = [](Tick tick) { return tick == 3000 ? 1e6 : 0.0; }};
  const auto rows = run_virtual({}, load, 8000, limits);
  expect_rules(rows, limits);
  for (const auto& row : rows) ASSERT_EQ(row.decisions, limits.highest) << row.tick;
  // Nobody sees a burst: a frame is caught up with, and the rest is given up.
  const double frame = static_cast<double>(kTicksPerFrame);
  EXPECT_NEAR(static_cast<double>(rows.back().slow_ticks), 1000 - frame, 2);
  EXPECT_NEAR(rows.back().time_us * 1e-3,
              static_cast<double>(rows.back().tick + rows.back().slow_ticks), 2);
}

TEST(RateController, EightContactsAtOnceAreBroughtIntoTheBudgetAndGivenBack) {
  Machine machine;
  machine.per_sweep_us = 0.06;
  const Load load{.contacts = [](Tick tick) { return tick < 3000 || tick >= 9000 ? 1 : 8; }};
  const auto limits = roomy_limits();
  const auto rows = run_virtual(machine, load, 20'000, limits);
  expect_rules(rows, limits);
  EXPECT_EQ(rows[2990].sweeps, kAll);
  EXPECT_GT(rows[3000].work_us, 900) << "the load is a load";
  EXPECT_GT(kept_share(rows, 3100, 9000), 0.999);
  EXPECT_EQ(direction_changes(rows, 0, 9000), 0);
  EXPECT_EQ(rows.back().decisions, limits.highest);
  EXPECT_LE(direction_changes(rows, 0, 20'000), 1);
  // All of it in less than a tenth of a second.
  for (std::size_t i = 3099; i < 8990; ++i) ASSERT_EQ(rows[i].decisions, rows[8990].decisions);
}

// A hand that touches and lifts twice a second must not take quality up and down with it.
TEST(RateController, AHandThatLiftsForAMomentChangesNothing) {
  Machine machine;
  machine.per_sweep_us = 0.06;
  const Load load{.contacts = [](Tick tick) { return tick % 500 < 300 ? 8 : 1; }};
  const auto limits = roomy_limits();
  const auto rows = run_virtual(machine, load, 20'000, limits);
  expect_rules(rows, limits);
  EXPECT_LE(direction_changes(rows, 0, 20'000), 2);
  EXPECT_GT(kept_share(rows, 1000, 20'000), 0.99);
}

TEST(RateController, WhenTheLeastIsTooMuchTimeSlowsCountedAndNoContactIsLost) {
  Machine machine;
  machine.per_sweep_us = 0.15;
  const Load load{.contacts = [](Tick tick) { return tick < 2000 ? 1 : 16; }};
  const auto limits = roomy_limits();
  const auto rows = run_virtual(machine, load, 6000, limits);
  EXPECT_EQ(rows.back().sweeps, kLeast);
  EXPECT_EQ(rows.back().level, RateLevel::Overloaded);
  EXPECT_GT(rows.back().slow_ticks, 1000u);
  EXPECT_NEAR(rows.back().time_us * 1e-3,
              static_cast<double>(rows.back().tick + rows.back().slow_ticks),
              static_cast<double>(kTicksPerFrame) + 1)
      << "the Pacer's books are the virtual clock";
  for (const auto& row : rows) {
    ASSERT_GE(row.queue_nodes, row.contact_nodes);
    ASSERT_GE(row.sweeps[0], limits.touched_sweeps);
  }
  EXPECT_EQ(direction_changes(rows, 0, 6000), 0);
}

TEST(RateController, TheOrderIsDeepLayersThenTouchedNodesThenTheNodeLimit) {
  Machine machine;
  machine.per_sweep_us = 0.3;
  const auto limits = roomy_limits();
  const auto rows = run_virtual(machine, {.contacts = [](Tick) { return 8; }}, 2000, limits);
  expect_rules(rows, limits);
  std::vector<step::LayerCounts> seen{rows[0].sweeps};
  for (const auto& row : rows)
    if (row.sweeps != seen.back()) seen.push_back(row.sweeps);
  const std::vector<step::LayerCounts> expected{
      {4, 4, 4, 4}, {4, 4, 4, 3}, {4, 4, 4, 2}, {4, 4, 4, 1}, {4, 4, 3, 1}, {4, 4, 2, 1},
      {4, 4, 1, 1}, {4, 3, 1, 1}, {4, 2, 1, 1}, {4, 1, 1, 1}, {3, 1, 1, 1}, {2, 1, 1, 1}};
  EXPECT_EQ(seen, expected);
  EXPECT_EQ(rows.back().node_limit, limits.nodes);
}

// How often far nodes are swept is given up between the sweeps of the queue and its nodes, and
// taken back between them, too.
TEST(RateController, FarNodesAreSweptLessOftenBeforeTheQueueLosesNodes) {
  Machine machine;
  machine.per_sweep_us = 0.3;
  auto limits = roomy_limits();
  limits.far_interval = 3;
  const Load load{.contacts = [](Tick tick) { return tick < 3000 ? 8 : 0; },
                  .slowness = [](Tick tick) { return tick < 3000 ? 1.0 : 0.05; }};
  const auto rows = run_virtual(machine, load, 40'000, limits);
  for (const auto& row : rows) {
    ASSERT_TRUE(row.decisions.far_interval == 1 || row.sweeps == kLeast) << row.tick;
    ASSERT_TRUE(row.node_limit >= row.queue_nodes || row.decisions.far_interval == 3) << row.tick;
  }
  EXPECT_EQ(rows[2999].decisions.far_interval, 3u);
  EXPECT_EQ(rows.back().decisions, limits.highest) << "all is taken back";
}

RateLimits limits_with_extra() {
  auto limits = roomy_limits();
  limits.highest.sweeps = 3;
  limits.highest.layer_sweeps = {2, 1, 1};
  limits.most_far_sweeps = kMostFarSweeps;
  return limits;
}

// A small organ: the full solution of a tick has room in the budget, but only while one hand acts.
TEST(RateController, RoomThatIsLeftGoesIntoAccuracyAndIsTheFirstToGo) {
  const auto limits = limits_with_extra();
  const Machine small{.per_sweep_us = 0.04, .far_nodes = 1500};
  const Load load{.contacts = [](Tick tick) { return tick < 100 ? 0 : tick < 2000 ? 1 : 3; }};
  const auto rows = run_virtual(small, load, 6000, limits);
  for (const auto& row : rows) {
    ASSERT_TRUE(step::validate(row.decisions).ok()) << row.tick;
    ASSERT_EQ(row.level, RateLevel::Full) << row.tick;
    ASSERT_LE(row.decisions.far_sweeps, kMostFarSweeps);
    for (std::size_t layer = 0; layer < step::kSweepLayers; ++layer)
      ASSERT_GE(row.sweeps[layer], step::sweeps_of_layers(limits.highest)[layer]) << row.tick;
  }
  EXPECT_EQ(rows[99].decisions, limits.highest) << "nobody touches";
  EXPECT_EQ(rows[1999].decisions.far_sweeps, 6u) << "above this three quarters are full";
  EXPECT_EQ(rows[1999].sweeps, (step::LayerCounts{12, 12, 12, 12}));
  EXPECT_LE(rows[2020].work_us, limits.budget_us) << "three hands";
  EXPECT_GT(rows[2020].decisions.far_sweeps, 0u) << "what fits stays";
  EXPECT_LE(direction_changes(rows, 2100, 6000), 2);
}

TEST(RateController, AMachineWithoutRoomGetsNothingExtra) {
  const auto limits = limits_with_extra();
  const Machine full{.per_sweep_us = 0.06};
  for (const auto& row : run_virtual(full, {}, 3000, limits))
    ASSERT_EQ(row.decisions, limits.highest) << row.tick;
}

TEST(RateController, WhoeverIsLateGetsNothingExtra) {
  const auto limits = limits_with_extra();
  const Machine small{.per_sweep_us = 0.02, .far_nodes = 1500};
  const Load load{
      .spike_us = [](Tick tick) { return tick > 500 && tick % 32 == 0 ? 20'000.0 : 0.0; }};
  const auto rows = run_virtual(small, load, 3000, limits);
  EXPECT_EQ(rows[400].decisions.far_sweeps, kMostFarSweeps);
  for (std::size_t i = 1000; i < rows.size(); ++i)
    ASSERT_EQ(rows[i].decisions.far_sweeps, 0u) << rows[i].tick;
}

TEST(RateController, MinimaAboveWhatIsAskedForAreWhatIsAskedFor) {
  const RateLimits limits{.highest = {.node_limit = 50, .sweeps = 1},
                          .touched_sweeps = 3,
                          .layer_sweeps = 2,
                          .nodes = 400};
  Machine machine;
  machine.per_sweep_us = 1;
  for (const auto& row : run_virtual(machine, {}, 1000, limits))
    ASSERT_EQ(row.decisions, limits.highest);
}

TEST(RateController, DecisionsAreAFunctionOfWhatItWasGiven) {
  Machine machine;
  machine.per_sweep_us = 0.06;
  const Load load{.contacts = [](Tick tick) { return static_cast<int>(tick / 700 % 9); },
                  .spike_us = [](Tick tick) { return tick % 33 == 0 ? 1500.0 : 0.0; }};
  const auto a = run_virtual(machine, load, 5000, roomy_limits()),
             b = run_virtual(machine, load, 5000, roomy_limits());
  for (std::size_t i = 0; i < a.size(); ++i) ASSERT_EQ(a[i].decisions, b[i].decisions);
}

// Random loads, speeds and spikes: the rules hold in all of them.
TEST(RateController, RandomMachinesNeverBreakTheRules) {
  for (std::uint32_t seed = 1; seed <= 40; ++seed) {
    std::uint32_t state = seed * 2654435761u;
    const auto random = [&state](double low, double high) {
      state = state * 1664525u + 1013904223u;
      return low + (high - low) * static_cast<double>(state >> 8) / static_cast<double>(1u << 24);
    };
    Machine machine;
    machine.fixed_us = random(20, 300);
    machine.per_sweep_us = random(0.005, 0.2);
    machine.noise = random(0, 0.2);
    const auto period = static_cast<Tick>(random(50, 3000));
    const auto hands = static_cast<int>(random(1, 17));
    const double spike = random(0, 5000);
    const Load load{
        .contacts = [=](Tick tick) { return tick / period % 2 == 0 ? 1 : hands; },
        .slowness = [=](Tick tick) { return tick / (3 * period) % 2 == 0 ? 1.0 : 1.7; },
        .spike_us = [=](Tick tick) { return tick % (period / 7 + 3) == 0 ? spike : 0.0; }};
    const auto limits = roomy_limits();
    const auto rows = run_virtual(machine, load, 8000, limits);
    expect_rules(rows, limits);
    EXPECT_LE(direction_changes(rows, 0, 8000), 30) << seed;
  }
}

}  // namespace
}  // namespace trocar::control
