// A thread alone and in the jaws of tools.

#include "server/tissue/thread/thread_step.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/counted_allocations.h"
#include "tests/support/random.h"
#include "tests/thread/laid_thread.h"

namespace trocar::thread {
namespace {

Rules hanging(double length_m) {
  auto rules = rules_of(silk_along({{0, 0, 0}, {length_m, 0, 0}}));
  rules.threads[0].start.is_held = true;
  return rules;
}

TEST(ThreadStep, ForcesAreThoseOfTheEnergy) {
  const auto rules = rules_of(silk_along({{0, 0, 0}, {0.02, 0, 0}}));
  Threads threads(rules);
  Elasticity elasticity(rules);
  testing::Random random(1);
  const auto shift = [&] { return random.between(-1e-4, 1e-4); };
  for (auto& place : threads.places_m) place += Vec3d{shift(), shift(), shift()};
  elasticity.begin(1e3, threads);  // inertia and damping vanish
  ChainSolver solver(kMostTouching);
  solver.begin(threads.node_count());
  elasticity.add(threads, solver);
  for (std::size_t i = 0; i < threads.node_count(); ++i) {
    const auto slope = [&](double& coordinate) {
      constexpr double kStep = 1e-9;
      const double middle = coordinate;
      coordinate = middle + kStep;
      const double more = elasticity.elastic_energy_j(threads);
      coordinate = middle - kStep;
      const double less = elasticity.elastic_energy_j(threads);
      coordinate = middle;
      return (more - less) / (2 * kStep);
    };
    auto& place = threads.places_m[i];
    const Vec3d force = solver.right(i),
                expected{-slope(place.x), -slope(place.y), -slope(place.z)};
    EXPECT_LT(length(force - expected), 1e-4 * (1 + length(expected))) << "node " << i;
  }
}

TEST(ThreadStep, StretchesByItsStiffness) {
  auto rules = hanging(0.3);
  rules.threads[0].end = {.load_n = {5, 0, 0}, .until_s = 0.1};
  LaidThread laid(rules);
  laid.run(400);
  const double exact = 5 / suture_of(Material::Silk, Size::Usp3_0).stretch_n;
  EXPECT_NEAR((laid.length_m() / 0.3 - 1) / exact, 1, 1e-3);
  EXPECT_NEAR(laid.threads.tensions_n[150], 5, 5e-3);
}

TEST(ThreadStep, DoesNotStretchUnderAJerk) {
  EXPECT_LT(strain_at_a_jerk(), 1e-3);
}

TEST(ThreadStep, LosesEnergy) {
  auto rules = hanging(0.1);
  LaidThread laid(rules);
  for (std::size_t i = 0; i < laid.threads.node_count(); ++i)
    laid.threads.velocities_m_s[i] = {0, 20.0 * laid.threads.places_m[i].x, 0};
  const auto energy_j = [&] {
    const auto& elasticity = laid.step.elasticity();
    return elasticity.kinetic_energy_j(laid.threads) + elasticity.elastic_energy_j(laid.threads);
  };
  double before = energy_j();
  for (int k = 0; k < 300; ++k) {
    laid.tick();
    EXPECT_LE(energy_j(), before * (1 + 1e-6)) << "tick " << k;
    before = energy_j();
  }
}

TEST(ThreadStep, BreaksUnderTooMuch) {
  auto rules = hanging(0.05);
  rules.threads[0].end = {.is_held = true, .velocity_m_s = {0.02, 0, 0}, .until_s = 1};
  LaidThread laid(rules);
  double most = 0;
  std::uint32_t broken = 0;
  for (int k = 0; k < 400 && broken == 0; ++k) {
    broken = laid.tick().broken;
    most = std::max(most, laid.threads.tensions_n[25]);
  }
  EXPECT_GT(broken, 0u);
  EXPECT_NEAR(most, suture_of(Material::Silk, Size::Usp3_0).breaks_n, 1.5);
}

TEST(ThreadStep, AllocatesNothingOnceWarm) {
  KnotInHands knot({{3, 1}}, 0.2);
  for (int k = 0; k < 200; ++k) knot.pull(0.05);
  const auto before = allocations.load();
  for (int k = 0; k < 50; ++k) knot.pull(0.05);
  EXPECT_EQ(allocations.load(), before);
}

TEST(ThreadStep, JawsTakeLiftAndDrop) {
  auto rules = rules_of(silk_along({{-0.03, 0, 0}, {0.03, 0, 0}}));
  rules.gravity_m_s2 = {0, -9.81, 0};
  rules.floor_y_m = 0;
  LaidThread laid(rules);
  laid.run(50);
  ToolNow tool = jaws_at({0, 0.003, 0}, {0, 1, 0});
  for (int k = 0; k < 150; ++k) laid.tick({&tool, 1});
  EXPECT_GE(laid.threads.holds.nodes.size(), 3u);
  for (int k = 0; k < 200; ++k) {
    tool.pose.position.y += 2e-4f;
    laid.tick({&tool, 1});
  }
  EXPECT_NEAR(laid.threads.places_m[30].y, 0.043, 2e-3);
  const double weight_n = 0.06 * 46e-6 * 9.81;
  for (int k = 0; k < 300; ++k) laid.tick({&tool, 1});
  EXPECT_NEAR(-laid.step.pull(tool.tool).force_n.y / weight_n, 1, 0.05);
  tool.verb = tool::Verb::None;
  for (int k = 0; k < 600; ++k) laid.tick({&tool, 1});
  EXPECT_TRUE(laid.threads.holds.nodes.empty());
  EXPECT_LT(laid.threads.places_m[30].y, 0.002);
}

TEST(ThreadStep, SlidesThroughJawsThatHoldTooLittle) {
  auto rules = hanging(0.1);
  LaidThread laid(rules);
  ToolNow tool = jaws_at({0.07, 0, 0}, {0, 0, 1});
  tool.shape.grip_n = 1;
  for (int k = 0; k < 150; ++k) laid.tick({&tool, 1});
  double most = 0;
  for (int k = 0; k < 400; ++k) {
    tool.pose.position.x += 2e-5f;
    laid.tick({&tool, 1});
    most = std::max(most, length(laid.step.pull(tool.tool).force_n));
  }
  EXPECT_GT(most, 0.8);
  EXPECT_LT(most, 1.1);
  ASSERT_FALSE(laid.threads.holds.nodes.empty());
  EXPECT_GT(laid.threads.holds.nodes.front(), 74u);  // it runs through them
}

TEST(ThreadStep, ANodeIsInOneToolsJaws) {
  auto rules = rules_of(silk_along({{-0.03, 0, 0}, {0.03, 0, 0}}));
  LaidThread laid(rules);
  ToolNow tools[2] = {jaws_at({0, 0, 0}, {0, 1, 0}), jaws_at({0.001, 0, 0}, {0, -1, 0})};
  tools[1].tool = ToolSlot{5};
  for (int k = 0; k < 120; ++k) laid.tick(tools);
  auto nodes = laid.threads.holds.nodes;
  std::sort(nodes.begin(), nodes.end());
  EXPECT_TRUE(std::adjacent_find(nodes.begin(), nodes.end()) == nodes.end());
  EXPECT_GT(std::ranges::count(laid.threads.holds.tools, ToolSlot{5}), 0);
}

TEST(ThreadStep, ABladePartsIt) {
  auto rules = rules_of(silk_along({{-0.03, 0, 0}, {0.03, 0, 0}}));
  LaidThread laid(rules);
  ToolNow tool = jaws_at({0, 0, 0.005}, {0, 0, 1});
  tool.verb = tool::Verb::Cut;
  tool.can_cut = true;
  tool.edge_m[0] = {0.0002, 0, -0.002}, tool.edge_m[1] = {0.0002, 0, 0.002};
  EXPECT_EQ(laid.tick({&tool, 1}).cut, 1u);
  EXPECT_EQ(laid.threads.is_joined[30], 0);
  for (int k = 0; k < 200; ++k) {
    laid.threads.velocities_m_s[0] = {-0.05, 0, 0};
    laid.tick();
  }
  EXPECT_GT(length(laid.threads.places_m[31] - laid.threads.places_m[30]), 2e-3);
}

}  // namespace
}  // namespace trocar::thread
