#include "server/session/control/tool_waits.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>
#include <vector>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/simulation.h"

namespace trocar::control {
namespace {

constexpr float kQuick = 2 * ToolWaits::kOrdinary_m_s, kSlow = 0.9f * ToolWaits::kOrdinary_m_s;

// Tools go with these speeds while they may; ticks take `busy` while a quick one does, else
// `idle`. Returns the bits that waited, tick for tick.
std::vector<std::uint32_t> waits_of(std::vector<float> speeds, double busy, double idle,
                                    Tick ticks) {
  ToolWaits waits;
  std::vector<std::uint32_t> rows;
  for (Tick tick = 0; tick < ticks; ++tick) {
    const auto waiting = waits.waiting();
    rows.push_back(waiting);
    std::array<float, kMaxTools> now{};
    bool is_busy = false;
    for (std::size_t i = 0; i < speeds.size(); ++i) {
      if ((waiting >> i & 1) != 0) continue;
      now[i] = speeds[i];
      is_busy |= now[i] > ToolWaits::kOrdinary_m_s;
    }
    waits.observe(now, is_busy ? busy : idle);
  }
  return rows;
}

double mean_of(const std::vector<std::uint32_t>& rows, std::size_t tool) {
  double sum = 0;
  for (const auto row : rows) sum += row >> tool & 1;
  return sum / static_cast<double>(rows.size());
}

// Returns the lengths of a tool's waits, in ticks, but for one at the end.
std::vector<int> lengths_of(const std::vector<std::uint32_t>& rows, std::size_t tool) {
  std::vector<int> lengths;
  int length = 0;
  for (const auto row : rows) {
    if ((row >> tool & 1) != 0) {
      ++length;
    } else if (length > 0) {
      lengths.push_back(std::exchange(length, 0));
    }
  }
  return lengths;
}

TEST(ToolWaits, NoOrdinaryToolWaitsHoweverLateTicksAre) {
  for (const auto row : waits_of({kSlow, kSlow, kSlow}, 9, 9, 5000)) ASSERT_EQ(row, 0u);
}

TEST(ToolWaits, NoToolWaitsWhileThereIsTime) {
  for (const auto row : waits_of({9, 9, 9}, 0.85, 0.85, 5000)) ASSERT_EQ(row, 0u);
}

TEST(ToolWaits, WhoSlowsTimeWaitsAndNobodyElse) {
  const auto rows = waits_of({kSlow, kQuick, kSlow}, 3, 0.3, 10'000);
  EXPECT_EQ(mean_of(rows, 0), 0);
  EXPECT_GT(mean_of(rows, 1), 0.5);
  EXPECT_LT(mean_of(rows, 1), 0.95) << "it goes on now and then";
  EXPECT_EQ(mean_of(rows, 2), 0);
  // The first spikes change nothing, and soon it waits all the same.
  EXPECT_EQ(rows[16], 0u);
  EXPECT_EQ(rows[48], 2u);
  const auto lengths = lengths_of(rows, 1);
  ASSERT_GT(lengths.size(), 5u);
  EXPECT_GE(lengths[0], static_cast<int>(ToolWaits::kWait));
  EXPECT_LT(lengths[0], static_cast<int>(ToolWaits::kWaitAgain));
  for (std::size_t i = 1; i < lengths.size(); ++i)
    EXPECT_GE(lengths[i], static_cast<int>(ToolWaits::kWaitAgain));
}

// Others may need the time for long.
TEST(ToolWaits, NobodyWaitsLongerThanASecondHoweverBusyOthersAre) {
  for (const double idle : {0.7, 3.0}) {
    const auto lengths = lengths_of(waits_of({kQuick}, 3, idle, 10'000), 0);
    ASSERT_GT(lengths.size(), 5u);
    for (const int length : lengths)
      EXPECT_EQ(length, static_cast<int>(ToolWaits::kMostWait)) << idle;
  }
}

TEST(ToolWaits, EightThatSlowTimeGoOnOneByOne) {
  const auto rows = waits_of(std::vector<float>(8, kQuick), 3, 0.3, 10'000);
  for (std::size_t tick = 1; tick < rows.size(); ++tick) {
    const auto released = std::popcount(rows[tick - 1] & ~rows[tick]);
    ASSERT_LE(released, 1) << tick;
  }
  for (std::size_t tool = 0; tool < 8; ++tool) {
    EXPECT_GT(mean_of(rows, tool), 0.5);
    EXPECT_GT(lengths_of(rows, tool).size(), 3u) << "everybody's turn comes";
  }
}

TEST(ToolWaits, AStallIsNobodysFault) {
  ToolWaits waits;
  std::array<float, kMaxTools> speeds{kQuick};
  for (Tick tick = 0; tick < 2000; ++tick) {
    waits.observe(speeds, tick == 1000 ? 5000 : 0.5);
    ASSERT_EQ(waits.waiting(), 0u) << tick;
  }
}

TEST(ToolWaits, AWaitIsToldForASecondMore) {
  ToolWaits waits;
  std::array<float, kMaxTools> speeds{kQuick};
  Tick began = 0, ended = 0, told = 0;
  for (Tick tick = 1; tick < 5000; ++tick) {
    waits.observe(speeds, began == 0 ? 3 : 0.2);
    if (waits.waiting() != 0 && began == 0) began = tick, speeds = {};
    if (waits.waiting() == 0 && began > 0 && ended == 0) ended = tick;
    if (waits.waited_lately() == 1) told = tick;
  }
  EXPECT_GT(ended, began);
  EXPECT_EQ(told, ended + kTicksPerSecond - 1);
}

// Jaws swing the top of the organ to and fro; a finger rests beside them.
TEST(TissueSpeeds, WhoIsCarriedAlongByOthersIsNotFast) {
  const auto organ = *catalogue::make_liver(1500);
  const auto top = to_float(*std::ranges::max_element(organ.mesh.rest_positions, {}, &Vec3d::y));
  step::Simulation simulation(organ);
  TissueSpeeds speeds;
  const ToolSlot jaws = tool_slot({0}, 0), finger = tool_slot({1}, 0);
  hands::TickInputs inputs;
  for (std::uint8_t i = 0; i < 2; ++i) {
    hands::HandJoin join{.slot = {i}};
    join.shapes[0] = {.radius_m = 0.008f, .length_m = 0.3f, .reach_m = 0.02f, .grip_n = 100};
    inputs.joins.push_back(join);
  }
  float swings_m_s = 0, rests_m_s = 0;
  int pressed = 0;
  for (int tick = 0; tick < 600; ++tick) {
    const float t = static_cast<float>(tick) * kTickSeconds;
    const Vec3f swing{0.02f * std::sin(20 * std::max(0.0f, t - 0.2f)), 0, 0};
    const auto put = [&](ToolSlot tool, const Vec3f& tip, tool::Verb verb) {
      inputs.samples.push_back({tool, {{tip, rotation_from_z({0, 1, 0})}, verb}});
    };
    put(jaws, top + swing, tool::Verb::Grasp);
    put(finger, top + Vec3f{0.03f, std::max(-0.012f, 0.02f - 0.2f * t), 0}, tool::Verb::Push);
    simulation.tick(inputs, {});
    inputs.clear();
    const auto now = speeds.read(simulation);
    if (tick < 250) continue;
    pressed += simulation.state().proxies[finger].presses();
    swings_m_s = std::max(swings_m_s, now[jaws.value]);
    rests_m_s = std::max(rests_m_s, now[finger.value]);
  }
  EXPECT_GT(pressed, 50);
  EXPECT_GT(swings_m_s, ToolWaits::kOrdinary_m_s);
  EXPECT_LT(rests_m_s, 1e-3f);
}

}  // namespace
}  // namespace trocar::control
