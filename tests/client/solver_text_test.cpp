#include "client/ui/solver_text.h"

#include <gtest/gtest.h>

#include <limits>

namespace trocar::ui {
namespace {

using wire::SolverReason;

TEST(SolverText, SaysWhichSolverActsAndWhy) {
  const auto reduced = describe({true, SolverReason::Fits, {{11}, 1}, 0.055f, 0.1f});
  EXPECT_EQ(reduced.state, "reduced, patch 12");
  EXPECT_EQ(reduced.error, "5.5 % in energy");
  EXPECT_TRUE(reduced.is_reduced);
  EXPECT_EQ(describe({true, SolverReason::Fits, {{2, 11}, 2}, 0, 0}).state,
            "reduced, patches 3 + 12");
  const auto full = describe({false, SolverReason::Cut, {}, 0, 0.1f});
  EXPECT_EQ(full.state, "full (tissue was cut)");
  EXPECT_EQ(full.error, "");
  EXPECT_FALSE(full.is_reduced);
  EXPECT_EQ(describe(wire::SolverFigures{}).state, "full");
  for (int reason = 1; reason <= static_cast<int>(SolverReason::Preparing); ++reason)
    EXPECT_GT(describe({.reason = static_cast<SolverReason>(reason)}).state.size(), 6u) << reason;
}

TEST(SolverText, ErrorsArePercentages) {
  const auto error = [](float estimate) {
    return describe({true, SolverReason::Fits, {{0}, 1}, estimate, 0}).error;
  };
  EXPECT_EQ(error(0), "below 0.1 % in energy");
  EXPECT_EQ(error(0.02f), "2.0 % in energy");
  EXPECT_EQ(error(0.25f), "25 % in energy");
  EXPECT_EQ(error(1), "over 100 % in energy");
  EXPECT_EQ(error(std::numeric_limits<float>::max()), "over 100 % in energy");
}

TEST(SolverText, SaysHowFarTheGhostIs) {
  replica::Ghost ghost;
  EXPECT_EQ(describe(ghost, false), "asked for");
  EXPECT_EQ(describe(ghost, true), "none: recordings have no ghost");
  ghost.status = replica::GhostStatus::None;
  EXPECT_EQ(describe(ghost, false), "none: this session has no reduction");
  ghost.status = replica::GhostStatus::Follows;
  EXPECT_EQ(describe(ghost, false), "waits for the surface");
  ghost.offsets.resize(4);
  ghost.largest_m = 2.14e-4f;
  ghost.root_mean_square_m = 3e-5f;
  ghost.behind_ms = 48;
  EXPECT_EQ(describe(ghost, false), "at most 0.21 mm away, rms 0.03 mm");
  ghost.behind_ms = 1240;
  EXPECT_EQ(describe(ghost, false), "at most 0.21 mm away, rms 0.03 mm; 1.2 s behind");
}

}  // namespace
}  // namespace trocar::ui
