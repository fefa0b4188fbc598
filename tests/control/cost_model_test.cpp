// The cost of a tick is learnt from ticks: level, slope, and what spikes may not do to either.

#include "server/session/control/cost_model.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace trocar::control {
namespace {

struct Noise {
  std::uint32_t state = 7;
  double next() {
    state = state * 1664525u + 1013904223u;
    return static_cast<double>(state >> 8) / static_cast<double>(1u << 24) - 0.5;
  }
};

void settle(CostModel& model, double x, double cost, int ticks = 100) {
  for (int i = 0; i < ticks; ++i) model.add(x, cost, 0.6);
}

TEST(CostModel, IsNotReadyBeforeItHasSeenEnough) {
  CostModel model;
  for (std::size_t i = 0; i + 1 < CostModel::kLevelWindow; ++i) {
    model.add(1e4, 300, 0.6);
    ASSERT_FALSE(model.is_ready());
  }
  model.add(1e4, 300, 0.6);
  ASSERT_TRUE(model.is_ready());
  EXPECT_NEAR(model.predict_us(1e4), 300, 1);
}

TEST(CostModel, OneSpikeOfAnySizeMovesNothing) {
  CostModel model;
  settle(model, 1e4, 300);
  model.add(1e4, 1e6, 0.6);
  for (int i = 0; i < 40; ++i) {
    EXPECT_NEAR(model.predict_us(1e4), 300, 0.01);
    model.add(1e4, 300, 0.6);
  }
}

TEST(CostModel, SixSpikesOfFifteenTicksMoveNothing) {
  CostModel model;
  settle(model, 1e4, 300);
  for (int i = 0; i < 300; ++i) {
    model.add(1e4, i % 5 < 2 ? 5000 : 300, 0.6);
    EXPECT_NEAR(model.predict_us(1e4), 300, 0.01);
  }
}

TEST(CostModel, ALastingChangeIsInItWithinTheStatedTicks) {
  for (const double cost : {150.0, 450.0, 600.0, 900.0}) {
    CostModel model;
    settle(model, 1e4, 300);
    settle(model, 1e4, cost, CostModel::kResponseTicks);
    EXPECT_NEAR(model.predict_us(1e4), cost, 0.1 * std::abs(cost - 300) + 1e-9) << cost;
  }
}

TEST(CostModel, LearnsTheSlopeFromChangesOfWork) {
  for (const double fixed : {50.0, 150.0, 240.0}) {
    const double slope = (300 - fixed) / 1e4;
    CostModel model;
    Noise noise;
    for (int i = 0; i < 3000; ++i) {
      const double x = (i / 20) % 2 == 0 ? 1e4 : 7e3;
      model.add(x, (fixed + slope * x) * (1 + 0.04 * noise.next()) + (i % 16 == 0 ? 400 : 0), 0.5);
    }
    EXPECT_NEAR(model.per_sweep_us(), slope, 0.15 * slope) << fixed;
    EXPECT_NEAR(model.predict_us(5e3), fixed + slope * 5e3, 0.1 * 300);
  }
}

TEST(CostModel, WithoutVariationTheSlopeStaysAsTheStagesSay) {
  CostModel model;
  Noise noise;
  for (int i = 0; i < 5000; ++i) model.add(1e4 + 300 * noise.next(), 300 + 30 * noise.next(), 0.6);
  EXPECT_NEAR(model.per_sweep_us() * 1e4 / model.predict_us(1e4), 0.6, 0.01);
}

TEST(CostModel, AnOrganAtRestThenTouchedIsPredicted) {
  CostModel model;
  settle(model, 0, 40);
  for (int i = 0; i < 20; ++i) model.add(4000, 40 + 0.03 * 4000, 0.8);
  EXPECT_NEAR(model.predict_us(4000), 160, 8);
  for (int i = 0; i < 500; ++i) {
    const double x = (i / 16) % 2 == 0 ? 0 : 4000;
    model.add(x, 40 + 0.03 * x, 0.8);
  }
  EXPECT_NEAR(model.predict_us(4000), 160, 8);
}

}  // namespace
}  // namespace trocar::control
