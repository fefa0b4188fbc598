// Thread on rigid pegs and tools: friction by the capstan's law, and nothing passes through.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/thread/laid_thread.h"

namespace trocar::thread {
namespace {

constexpr double kPegM = 5e-3, kLoadN = 0.5, kSpeed = 0.02;

// Drawn over the peg by its end, with a load on its start. Returns force over load.
double drawn_over_peg(double angle, double friction) {
  const auto rules = around_peg(angle, friction, kPegM, kLoadN, kSpeed);
  EXPECT_TRUE(validate(rules).ok());
  LaidThread laid(rules);
  double sum = 0;
  laid.run(400);
  for (int k = 0; k < 200; ++k) {
    laid.tick();
    sum += length(laid.step.end_forces()[0].end_n);
  }
  return sum / 200 / kLoadN;
}

TEST(Pegs, ThreadIsDrawnOverThemByTheCapstansLaw) {
  const std::pair<double, double> cases[] = {{1.0, 0.3}, {4.0, 0.3}, {9.42, 0.05}};
  for (const auto& [angle, friction] : cases) {
    const double exact = std::exp(friction * angle);
    EXPECT_NEAR(drawn_over_peg(angle, friction) / exact, 1, 0.03) << angle << ", " << friction;
  }
}

TEST(Pegs, ThreadAtRestStaysAtRest) {
  auto rules = around_peg(4, 0.3, kPegM, kLoadN, 0);
  rules.threads[0].end = {.load_n = Vec3d{std::cos(4.0), -std::sin(4.0), 0} * 0.6, .until_s = 0.2};
  LaidThread laid(rules);
  laid.run(1500);
  const auto before = laid.threads.places_m;
  laid.run(300);
  double moved = 0;
  for (std::size_t i = 0; i < before.size(); ++i)
    moved = std::max(moved, length(laid.threads.places_m[i] - before[i]));
  EXPECT_LT(moved, 20e-6);
}

// A straight thread flies at a thin peg.
TEST(Pegs, NothingPassesThroughHoweverFast) {
  for (const double speed : {0.5, 2.0, 5.0}) {
    auto rules = rules_of(silk_along({{-0.03, 0.01, 0}, {0.03, 0.01, 0}}));
    rules.pegs.push_back({{0, 0, -0.05}, {0, 0, 0.05}, 1e-3, 0.2});
    LaidThread laid(rules);
    std::ranges::fill(laid.threads.velocities_m_s, Vec3d{0, -speed, 0});
    double least_middle = 1, least_end = 1;
    for (int k = 0; k < 60; ++k) {
      laid.tick();
      least_middle = std::min(least_middle, laid.threads.places_m[30].y);
      least_end = std::min(least_end, laid.threads.places_m[0].y);
    }
    EXPECT_NEAR(least_middle, 1e-3, 5e-5) << speed;  // of the peg's surface
    EXPECT_LT(least_end, 0) << speed;
  }
}

TEST(Pegs, ThreadFallsOnTheFloor) {
  auto rules = rules_of(silk_along({{-0.03, 0.01, 0}, {0.03, 0.01, 0}}));
  rules.gravity_m_s2 = {0, -9.81, 0};
  rules.floor_y_m = -0.01;
  LaidThread laid(rules);
  laid.run(500);
  for (const auto& place : laid.threads.places_m) EXPECT_NEAR(place.y, -0.01, 5e-5);
}

}  // namespace
}  // namespace trocar::thread
