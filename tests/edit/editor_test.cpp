// Each operation of the editor: what it changes, what it leaves, what it refuses.

#include "server/organs/edit/editor.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/edit/box_rule.h"

namespace trocar::edit {
namespace {

using Nodes = std::vector<NodeIndex>;

organ::Organ liver() {
  static const auto kLiver = *catalogue::make_liver(1000);
  return kLiver;
}

Nodes box(const organ::Organ& organ, const char* text) {
  return nodes_in(*parse_box_rule(text, "test"), organ.mesh);
}

TEST(Editor, HoldsAndReleases) {
  Editor editor(liver());
  const auto before = editor.organ();
  const auto left = box(before, "x=..-60");
  ASSERT_FALSE(left.empty());
  EXPECT_TRUE(editor.hold(left));
  for (const NodeIndex node : left)
    EXPECT_TRUE(std::ranges::binary_search(editor.organ().fixed_nodes, node));
  EXPECT_TRUE(std::ranges::includes(editor.organ().fixed_nodes, before.fixed_nodes));
  EXPECT_FALSE(editor.hold(left)) << "nothing is new";
  EXPECT_TRUE(editor.release(box(before, "all")));
  EXPECT_TRUE(editor.organ().fixed_nodes.empty());
  EXPECT_FALSE(editor.release(left));
  EXPECT_EQ(editor.organ().mesh, before.mesh);
  EXPECT_EQ(editor.organ().node_masses_kg, before.node_masses_kg);
  EXPECT_TRUE(organ::validate(editor.organ()).ok());
}

TEST(Editor, NodesMayComeInAnyOrderAndFromOutside) {
  Editor editor(liver());
  editor.release(box(editor.organ(), "all"));
  const Nodes nodes{NodeIndex(7), NodeIndex(3), NodeIndex(7), NodeIndex(4'000'000)};
  EXPECT_TRUE(editor.hold(nodes));
  EXPECT_EQ(editor.organ().fixed_nodes, (Nodes{NodeIndex(3), NodeIndex(7)}));
}

TEST(Editor, UndoAndRedoGoStepByStep) {
  Editor editor(liver());
  const auto first = editor.organ();
  EXPECT_FALSE(editor.undo());
  EXPECT_FALSE(editor.redo());
  editor.hold(box(first, "x=..-60"));
  const auto second = editor.organ();
  editor.hold(box(first, "x=60.."));
  const auto third = editor.organ();
  EXPECT_TRUE(editor.undo());
  EXPECT_EQ(editor.organ(), second);
  EXPECT_TRUE(editor.undo());
  EXPECT_EQ(editor.organ(), first);
  EXPECT_FALSE(editor.has_unsaved_changes());
  EXPECT_TRUE(editor.redo());
  EXPECT_TRUE(editor.redo());
  EXPECT_EQ(editor.organ(), third);
  EXPECT_FALSE(editor.redo());
  editor.undo();
  editor.release(box(first, "all"));
  EXPECT_FALSE(editor.can_redo()) << "another way was taken";
}

TEST(Editor, AStrokeIsOneStep) {
  Editor editor(liver());
  const auto first = editor.organ();
  editor.begin_stroke();
  editor.hold(box(first, "x=..-60"));
  editor.hold(box(first, "x=60.."));
  editor.end_stroke();
  editor.hold(box(first, "y=20.."));
  EXPECT_TRUE(editor.undo());
  EXPECT_TRUE(editor.undo());
  EXPECT_EQ(editor.organ(), first);
  EXPECT_FALSE(editor.can_undo());
  editor.begin_stroke();
  editor.end_stroke();
  EXPECT_FALSE(editor.can_undo()) << "a stroke that changed nothing is no step";
}

TEST(Editor, KeepsABoundedNumberOfSteps) {
  Editor editor(liver());
  editor.release(box(editor.organ(), "all"));
  for (std::size_t i = 0; i < kMostSteps + 50; ++i) {
    const Nodes node{NodeIndex(i % 2)};
    i % 4 < 2 ? editor.hold(node) : editor.release(node);
  }
  std::size_t steps = 0;
  while (editor.undo()) ++steps;
  EXPECT_EQ(steps, kMostSteps);
}

TEST(Editor, ARegionTakesItsElementsAndGivesThemBack) {
  Editor editor(liver());
  const auto first = editor.organ();
  const auto inner = box(first, "x=-60..60,y=-40..40");
  const auto region = editor.add_region("tumour", inner);
  ASSERT_TRUE(region.ok()) << region.error().message;
  EXPECT_EQ(*region, 0u);
  const auto counts = editor.element_counts();
  ASSERT_EQ(counts.size(), 2u);
  EXPECT_GT(counts[1], 0u);
  EXPECT_EQ(counts[0] + counts[1], first.mesh.tets.size());
  EXPECT_TRUE(editor.add_to_region(0, box(first, "x=..0")));
  EXPECT_GT(editor.element_counts()[1], counts[1]);
  EXPECT_TRUE(editor.take_from_region(0, box(first, "x=..0")));
  EXPECT_LT(editor.element_counts()[1], counts[1]);
  EXPECT_TRUE(editor.take_from_region(0, box(first, "all")));
  EXPECT_TRUE(editor.organ().regions.empty()) << "nothing is left of it";
  EXPECT_FALSE(editor.add_to_region(3, inner));
  while (editor.undo()) {
  }
  EXPECT_EQ(editor.organ(), first);
}

TEST(Editor, RefusesRegionsThatCannotBe) {
  Editor editor(liver());
  const auto first = editor.organ();
  const auto all = box(first, "all");
  EXPECT_FALSE(editor.add_region("", all).ok());
  EXPECT_FALSE(editor.add_region("a\nb", all).ok());
  EXPECT_FALSE(editor.add_region("Gef\xe4\xdf", all).ok())
      << "Latin-1, which no organ file can hold";
  EXPECT_FALSE(editor.add_region(std::string(201, 'a'), all).ok());
  EXPECT_FALSE(editor.add_region("dot", Nodes{NodeIndex(0)}).ok());
  ASSERT_TRUE(editor.add_region("all", all).ok());
  EXPECT_FALSE(editor.add_region("all", all).ok());
  EXPECT_TRUE(editor.undo());
  EXPECT_EQ(editor.organ(), first);
}

TEST(Editor, RenamesARegion) {
  Editor editor(liver());
  const auto all = box(editor.organ(), "all");
  ASSERT_TRUE(editor.add_region("a", all).ok());
  ASSERT_TRUE(editor.rename_region(0, "lump").ok());
  EXPECT_EQ(editor.organ().regions[0].name, "lump");
  EXPECT_FALSE(editor.rename_region(0, "").ok());
  EXPECT_FALSE(editor.rename_region(1, "b").ok());
  ASSERT_TRUE(editor.add_region("b", all).ok());
  EXPECT_FALSE(editor.rename_region(1, "lump").ok()) << "it is taken";
  editor.undo();
  editor.undo();
  EXPECT_EQ(editor.organ().regions[0].name, "a");
}

TEST(Editor, LaterRegionsWin) {
  Editor editor(liver());
  const auto all = box(editor.organ(), "all");
  ASSERT_TRUE(editor.add_region("a", all).ok());
  ASSERT_TRUE(editor.add_region("b", all).ok());
  EXPECT_EQ(editor.element_counts()[1], 0u);
  EXPECT_EQ(editor.remarks().size(), 1u);
  EXPECT_TRUE(editor.raise_region(0));
  EXPECT_EQ(editor.organ().regions.back().name, "a");
  EXPECT_EQ(editor.element_counts()[1], 0u) << "now b is covered";
  EXPECT_FALSE(editor.raise_region(1)) << "it is the last already";
  EXPECT_TRUE(editor.remove_region(1));
  EXPECT_EQ(editor.organ().regions.size(), 1u);
}

TEST(Editor, GivesPartsAMeasuredMaterial) {
  Editor editor(liver());
  const auto first = editor.organ();
  const auto& measured = material::measured_materials().front();
  ASSERT_TRUE(editor.add_region("lump", box(first, "x=0..")).ok());
  ASSERT_TRUE(editor.use_measured(0, measured).ok());
  const auto& lump = editor.organ().regions[0].material;
  EXPECT_EQ(lump.elastic_law, material::ElasticLaw::Measured);
  EXPECT_EQ(lump.measured, measured);
  EXPECT_EQ(lump.density_kg_m3, first.material.density_kg_m3);
  EXPECT_TRUE(lump.has_averaged_strain);
  EXPECT_EQ(editor.organ().material.elastic_law, first.material.elastic_law);
  ASSERT_TRUE(editor.use_neo_hookean(std::nullopt, 9000, 0.4).ok());
  EXPECT_EQ(editor.organ().material.young_modulus_pa, 9000);
  EXPECT_EQ(editor.organ().regions[0].material.measured, measured);
  EXPECT_FALSE(editor.use_measured(7, measured).ok());
  EXPECT_FALSE(editor.use_neo_hookean(0, -1, 0.4).ok());
  EXPECT_FALSE(editor.use_neo_hookean(0, 1000, 0.6).ok());
  EXPECT_EQ(editor.organ().node_masses_kg, first.node_masses_kg);
  EXPECT_TRUE(organ::validate(editor.organ()).ok());
  while (editor.undo()) {
  }
  EXPECT_EQ(editor.organ(), first);
}

TEST(Editor, ALatticeStaysOfSprings) {
  Editor editor(catalogue::make_lattice());
  const auto status = editor.use_measured(std::nullopt, material::measured_materials().front());
  ASSERT_FALSE(status.ok());
  EXPECT_NE(status.error().message.find("no tets"), std::string::npos) << status.error().message;
  EXPECT_FALSE(editor.has_unsaved_changes());
}

// A region of another density takes its mass along: 1 ml of it has that of its density.
TEST(Editor, MassesFollowTheDensityOfRegions) {
  auto organ = liver();
  const auto half = box(organ, "x=0..");
  organ.regions.push_back({"heavy", organ.material, half});
  organ.regions[0].material.density_kg_m3 = 2 * organ.material.density_kg_m3;
  organ.node_masses_kg = organ::lumped_masses(organ);
  Editor editor(organ);
  ASSERT_TRUE(editor.add_to_region(0, box(organ, "all")));
  double mass_kg = 0;
  for (const double mass : editor.organ().node_masses_kg) mass_kg += mass;
  EXPECT_NEAR(mass_kg, 2 * organ.material.density_kg_m3 * mesh::total_volume(organ.mesh),
              1e-9 * mass_kg);
}

TEST(Editor, SaysWhatSomebodyShouldKnow) {
  auto organ = liver();
  organ.stress_free_positions_m = organ.mesh.rest_positions;
  organ.depth_table = {.error = 0.05, .tool_radius_m = 0.01, .places = 1, .rows = {}};
  organ.depth_table.rows.push_back({.force_n = 1, .frozen_nodes = 10, .graded_depth = 3});
  Editor editor(organ);
  EXPECT_TRUE(editor.remarks().empty());
  editor.release(box(organ, "all"));
  EXPECT_EQ(editor.remarks().size(), 3u) << "held by nothing, settled, calibrated";
  EXPECT_TRUE(editor.organ().depth_table.rows.empty());
  editor.hold(box(organ, "all"));
  EXPECT_EQ(editor.remarks().size(), 3u) << "all held, settled, calibrated";
  editor.undo();
  editor.undo();
  EXPECT_TRUE(editor.remarks().empty());
  EXPECT_EQ(editor.organ(), organ);
}

}  // namespace
}  // namespace trocar::edit
