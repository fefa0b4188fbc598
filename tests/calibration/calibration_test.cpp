// Force to depth on a small organ: what is stored is what was measured, survives the file, and
// keeps its promise at places and speeds that were not used.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"
#include "server/lab/calibration/calibrate.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/organ/organ_file.h"
#include "server/session/control/depth_chooser.h"

namespace trocar::calibration {
namespace {

constexpr std::uint32_t kLeast = 200, kMost = 1200;

Settings small_settings() {
  return {.error = 0.03, .places = 3, .radius_m = 0.03, .depth_m = 0.006, .first_nodes = 64};
}

const organ::Organ& small_liver() {
  static const auto liver = catalogue::make_liver(1500);
  TROCAR_ASSERT(liver.ok());
  return *liver;
}

const Calibration& small_calibration() {
  static const auto calibration = calibrate(small_liver(), small_settings());
  return calibration;
}

organ::DepthTable sample_table() {
  return {.error = 0.03,
          .tool_radius_m = 0.02,
          .places = 8,
          .rows = {{0.5, 300, 1, 0.01, 0.02}, {1, 500, 2, 0.02, 0.02}, {2, {}, {}, 0.2, 0.1}}};
}

TEST(Places, AreSpreadDistinctFreeAndDrawnBySeed) {
  const auto& liver = small_liver();
  const auto places = spread_places(liver, 20, 1), again = spread_places(liver, 20, 1);
  ASSERT_EQ(places.size(), 20u);
  double nearest = 1;
  for (std::size_t i = 0; i < places.size(); ++i) {
    EXPECT_EQ(places[i].node, again[i].node);
    EXPECT_FALSE(std::ranges::binary_search(liver.fixed_nodes, places[i].node));
    EXPECT_NEAR(length(places[i].outward), 1, 1e-5);
    for (std::size_t k = 0; k < i; ++k)
      nearest =
          std::min(nearest, static_cast<double>(length(places[i].position - places[k].position)));
  }
  EXPECT_GT(nearest, 0.02);
  const auto others = spread_places(liver, 5, 1, places);
  for (const auto& other : others)
    for (const auto& place : places) EXPECT_NE(other.node, place.node);
}

TEST(Calibration, StoresTheLimitThatEveryPlaceNeeds) {
  const auto& calibration = small_calibration();
  ASSERT_GE(calibration.table.rows.size(), 2u);
  EXPECT_EQ(calibration.table.places + calibration.places_left_out, 3u);
  for (const auto& row : calibration.table.rows) {
    bool all_suffice = true;
    std::uint32_t largest = 0;
    for (const auto& finding : calibration.findings) {
      if (finding.force_n != row.force_n) continue;
      ASSERT_FALSE(finding.graded.empty());
      // The search ends with the first that suffices.
      for (std::size_t i = 0; i + 1 < finding.graded.size(); ++i)
        EXPECT_GT(finding.graded[i].error, 0.03);
      all_suffice = all_suffice && finding.graded.back().error <= 0.03;
      largest = std::max(largest, finding.graded.back().limit);
    }
    EXPECT_EQ(row.graded_depth.has_value(), all_suffice);
    if (row.graded_depth) {
      EXPECT_GE(*row.graded_depth, largest);
      EXPECT_LE(row.graded_error, 0.03);
    }
    if (row.frozen_nodes) {
      EXPECT_LE(row.frozen_error, 0.03);
    }
  }
}

TEST(Calibration, ReferenceReachesItsToleranceInEveryTick) {
  const auto& reference = small_calibration().reference;
  EXPECT_GT(reference.convergence.ticks, 0u);
  EXPECT_EQ(reference.convergence.reached, reference.convergence.ticks);
  EXPECT_LE(reference.convergence.largest_residual_n, reference.convergence.tolerance_n);
  EXPECT_EQ(reference.places_missed, 0u);
  // Something is measured, and it is less than what limits are judged by.
  EXPECT_GT(reference.own_error, 0);
  EXPECT_LE(reference.own_error, 0.1 * small_settings().error);
}

TEST(Convergence, ToleranceFollowsTheForceDownToWhatRoundingLeaves) {
  Pilot pilot;
  pilot.note({.tick = 5, .solve = {.figures = {.residual_n = 1}}}, 4);
  pilot.note({.tick = Pilot::kPilotTicks, .solve = {.figures = {.residual_n = 1e-6f}}}, 2);
  EXPECT_EQ(pilot.largest_force_n(), 4);
  EXPECT_FLOAT_EQ(pilot.tolerance_n(100), 1.2e-5f);
  EXPECT_FLOAT_EQ(pilot.tolerance_for(8, 100), 2.4e-5f);
  EXPECT_FLOAT_EQ(pilot.tolerance_for(4, 400), 6e-6f);
  EXPECT_FLOAT_EQ(pilot.tolerance_for(4, 100, kLooser), 1.2e-4f);
  EXPECT_FLOAT_EQ(pilot.tolerance_for(0.1, 100), 2e-6f);
  EXPECT_FLOAT_EQ(pilot.tolerance_for(0.1, 100, kLooser), 2e-5f);
}

TEST(Convergence, DecisionsAreValid) {
  EXPECT_TRUE(step::validate(converged_decisions(1e-5f)).ok());
  for (Tick tick = 1; tick <= Pilot::kPilotTicks; ++tick)
    EXPECT_TRUE(step::validate(Pilot::decisions(tick)).ok()) << tick;
}

TEST(Convergence, OneTickThatMissedIsSeen) {
  Convergence convergence;
  EXPECT_FALSE(convergence.is_reached());
  const auto decisions = converged_decisions(1e-5f);
  convergence.note({.solve = {.figures = {.sweeps = 7, .residual_n = 9e-6f}, .is_converged = true}},
                   decisions);
  EXPECT_TRUE(convergence.is_reached());
  convergence.note(
      {.solve = {.figures = {.sweeps = 500, .residual_n = 2e-5f}, .is_converged = false}},
      decisions);
  convergence.note({.solve = {.is_converged = true}}, {});
  EXPECT_FALSE(convergence.is_reached());
  EXPECT_EQ(convergence.words(),
            "tolerance 1e-05 N per node, reached in 1 of 2 ticks, largest residual 2e-05 N, at "
            "most 500 sweeps");
}

TEST(Calibration, IsDeterministic) {
  auto settings = small_settings();
  settings.places = 1;
  EXPECT_EQ(calibrate(small_liver(), settings).table, calibrate(small_liver(), settings).table);
}

TEST(Calibration, KeepsItsErrorAtPlacesAndSpeedsThatWereNotUsed) {
  const auto found = check(small_liver(), small_calibration().table, small_settings(), 3);
  EXPECT_TRUE(found.reference.is_converged()) << found.reference.convergence.words();
  std::size_t compared = 0;
  for (const auto& c : found.ranges) {
    if (c.places == 0) continue;
    ++compared;
    EXPECT_LE(c.graded_mean, 0.03) << c.force_n << " N";
    EXPECT_LE(c.graded_largest, 0.06) << c.force_n << " N";
  }
  EXPECT_GE(compared, 2u);
}

TEST(Calibration, FrozenNearContactsIsSeenToBeTooStiff) {
  // If a handful of nodes sufficed, the comparison would not compare.
  const auto& findings = small_calibration().findings;
  ASSERT_FALSE(findings.empty());
  double largest = 0;
  for (const auto& finding : findings) {
    ASSERT_FALSE(finding.frozen.empty());
    largest = std::max(largest, finding.frozen.front().error);
  }
  EXPECT_GT(largest, 0.06);
}

TEST(DepthTable, SurvivesTheOrganFileAndChangesNoHash) {
  auto organ = small_liver();
  const auto hash = organ::organ_hash(organ);
  organ.depth_table = sample_table();
  EXPECT_EQ(organ::organ_hash(organ), hash);
  const auto read = organ::unpack_organ(organ::pack_organ(organ));
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->depth_table, organ.depth_table);
  EXPECT_TRUE(*read == organ);
}

TEST(DepthTable, ThatCannotBeIsRefused) {
  for (int i = 0; i < 5; ++i) {
    auto organ = small_liver();
    organ.depth_table = sample_table();
    auto& table = organ.depth_table;
    if (i == 0) table.rows[1].force_n = 0.4;
    if (i == 1) table.error = 0;
    if (i == 2) table.rows[0].frozen_nodes = 0;
    if (i == 3) table.rows[0].graded_depth = 2000;
    if (i == 4) table.rows[2].graded_error = NAN;
    const auto read = organ::unpack_organ(organ::pack_organ(organ));
    EXPECT_FALSE(read.ok()) << i;
  }
}

TEST(DepthTable, AddsNodesAndTakesTheDeepest) {
  const auto table = sample_table();
  const std::vector<double> small{0.2, 0.7}, unknown{0.2, 1.5}, beyond{3};
  EXPECT_EQ(organ::frozen_nodes_for(table, small), 800u);
  EXPECT_EQ(organ::graded_depth_for(table, small), 2u);
  EXPECT_EQ(organ::frozen_nodes_for(table, unknown), std::nullopt);
  EXPECT_EQ(organ::graded_depth_for(table, beyond), std::nullopt);
  EXPECT_EQ(organ::frozen_nodes_for(table, {}), std::nullopt);
}

step::TickDecisions most(world::Boundary boundary) {
  return {.depth_limit = 6, .node_limit = kMost, .boundary = boundary};
}

TEST(DepthChooser, WithoutATableChangesNothing) {
  control::DepthChooser chooser({}, kLeast);
  const auto decided = most(world::Boundary::Frozen);
  EXPECT_EQ(chooser.choose(decided, std::vector<double>{0.1}), decided);
}

TEST(DepthChooser, GivesMoreAtOnceAndTakesBackSlowly) {
  control::DepthChooser chooser(sample_table(), kLeast);
  const auto decided = most(world::Boundary::Frozen);
  const std::vector<double> small{0.1}, large{0.8}, unknown{1.9};
  EXPECT_EQ(chooser.choose(decided, {}).node_limit, kLeast);
  EXPECT_EQ(chooser.choose(decided, small).node_limit, 300u);
  EXPECT_EQ(chooser.choose(decided, unknown).node_limit, kMost);
  int ticks = 0;
  while (chooser.choose(decided, small).node_limit > 300 && ticks < 5000) ++ticks;
  EXPECT_GT(ticks, control::DepthChooser::kHold);
  EXPECT_LT(ticks, 1000);
  EXPECT_EQ(chooser.choose(decided, large).node_limit, 500u);
  EXPECT_EQ(chooser.choose(decided, unknown).node_limit, kMost);
  EXPECT_EQ(chooser.choose(decided, {}).node_limit, kMost);
}

TEST(DepthChooser, StaysBetweenTheLeastAndWhatIsDecided) {
  auto table = sample_table();
  table.rows[0].frozen_nodes = 20;
  control::DepthChooser chooser(table, kLeast);
  auto decided = most(world::Boundary::Frozen);
  const std::vector<double> small{0.1}, large{0.8};
  EXPECT_EQ(chooser.choose(decided, small).node_limit, kLeast);
  decided.node_limit = 350;
  EXPECT_EQ(chooser.choose(decided, large).node_limit, 350u);
  decided.node_limit = 100;
  EXPECT_EQ(chooser.choose(decided, small).node_limit, 100u);
}

TEST(DepthChooser, LowersTheDepthALayerAtATimeWhereTheRestMoves) {
  control::DepthChooser chooser(sample_table(), kLeast);
  const auto decided = most(world::Boundary::Graded);
  const std::vector<double> small{0.1}, large{0.8};
  EXPECT_EQ(chooser.choose(decided, small).depth_limit, 1u);
  std::uint32_t before = chooser.choose(decided, std::vector<double>{1.9}).depth_limit;
  EXPECT_EQ(before, 6u);
  for (int i = 0; i < 1000; ++i) {
    const auto chosen = chooser.choose(decided, small);
    EXPECT_GE(chosen.depth_limit + 1, before);
    EXPECT_EQ(chosen.node_limit, kMost);
    before = chosen.depth_limit;
  }
  EXPECT_EQ(before, 1u);
  EXPECT_EQ(chooser.choose(decided, large).depth_limit, 2u);
}

}  // namespace
}  // namespace trocar::calibration
