#include "server/session/control/team_size.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

namespace trocar::control {
namespace {

// A tick takes this much of its time with so many threads.
using Cost = std::function<double(unsigned)>;

// A tenth of the work is serial.
double shared(double work, unsigned threads) {
  return work * (0.1 + 0.9 / threads);
}

// Returns the mean of how many worked in the last tenth of these ticks.
double team_after(TeamSize& team, int ticks, const Cost& cost, double idle = 8) {
  double sum = 0;
  team.set_idle(idle);
  for (int i = 0; i < ticks; ++i) {
    if (i >= ticks - ticks / 10) sum += team.count();
    const double load = cost(team.count());
    team.observe(load, load > 0.8);
  }
  return sum / (ticks / 10);
}

TEST(TeamSize, OneWorksWhileThatIsEnough) {
  TeamSize team(8);
  EXPECT_EQ(team_after(team, 20'000, [](unsigned n) { return shared(0.6, n); }), 1);
}

TEST(TeamSize, GrowsUntilTicksHaveTheirTime) {
  TeamSize team(8);
  EXPECT_EQ(team_after(team, 2000, [](unsigned n) { return shared(1.3, n); }), 2);
  // It takes 1.17 with four threads, and 0.77 with eight.
  EXPECT_EQ(team_after(team, 4000, [](unsigned n) { return shared(3.6, n); }), 8);
}

TEST(TeamSize, HasNoMoreThanThereMayBe) {
  unsigned largest = 0;
  const Cost cost = [&](unsigned n) {
    largest = std::max(largest, n);
    return shared(9, n);
  };
  TeamSize team(6);
  team_after(team, 4000, cost);
  EXPECT_EQ(largest, 6u);
  TeamSize alone(1);
  EXPECT_EQ(team_after(alone, 4000, cost), 1);
}

TEST(TeamSize, TriesNobodyWithoutAnIdleProcessor) {
  TeamSize team(8);
  EXPECT_EQ(team_after(
                team, 4000, [](unsigned n) { return shared(3.6, n); }, 0.4),
            1);
  EXPECT_EQ(team_after(
                team, 4000, [](unsigned n) { return shared(3.6, n); }, 0.6),
            2);
}

// A bigger team is slower where other programs have the other processors.
TEST(TeamSize, StaysAloneWhereThereAreNoIdleProcessors) {
  TeamSize team(8);
  int ticks_with_more = 0;
  const Cost cost = [&](unsigned n) {
    ticks_with_more += n > 1;
    return n == 1 ? 1.5 : 3.0;
  };
  team_after(team, 100'000, cost);
  EXPECT_LE(ticks_with_more, 2000) << "trials become rare";
}

TEST(TeamSize, GivesBackProcessorsThatOthersTake) {
  TeamSize team(4);
  EXPECT_EQ(team_after(team, 4000, [](unsigned n) { return shared(3.6, n); }), 4);
  EXPECT_NEAR(team_after(
                  team, 60'000, [](unsigned n) { return n == 1 ? 3.6 : 3.6 + n; }, 0),
              1, 0.1);
  EXPECT_NEAR(team_after(team, 60'000, [](unsigned n) { return shared(3.6, n); }), 4, 0.1);
}

// Waking threads costs more than a light tick.
TEST(TeamSize, LightTicksAreDoneAlone) {
  TeamSize team(4);
  EXPECT_EQ(team_after(team, 4000, [](unsigned n) { return shared(3.6, n); }), 4);
  EXPECT_EQ(team_after(team, 100, [](unsigned n) { return shared(0.05, n); }), 1);
  EXPECT_EQ(team_after(team, 100, [](unsigned n) { return shared(3.6, n); }), 4);
}

TEST(TeamSize, AStallDecidesNothing) {
  TeamSize team(2);
  int tick = 0;
  // Now and then the machine stands still for 50 ticks.
  const Cost cost = [&](unsigned n) { return ++tick % 400 == 0 ? 50 : shared(2, n); };
  EXPECT_NEAR(team_after(team, 10'000, cost), 2, 0.2) << "now and then one is tried";
}

}  // namespace
}  // namespace trocar::control
