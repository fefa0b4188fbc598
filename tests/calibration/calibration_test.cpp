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

TEST(Calibration, IsDeterministic) {
  auto settings = small_settings();
  settings.places = 1;
  EXPECT_EQ(calibrate(small_liver(), settings).table, calibrate(small_liver(), settings).table);
}

TEST(Calibration, KeepsItsErrorAtPlacesAndSpeedsThatWereNotUsed) {
  const auto checks = check(small_liver(), small_calibration().table, small_settings(), 3);
  std::size_t compared = 0;
  for (const auto& c : checks) {
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
