// Rules in numbers: what they read, what they refuse, which nodes they mean.

#include "server/organs/edit/box_rule.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/organs/catalogue/builtin_organs.h"

namespace trocar::edit {
namespace {

TEST(BoxRule, ReadsBoundsInMillimetres) {
  const auto rule = parse_box_rule("x=-10..20,z=..5,surface", "--hold");
  ASSERT_TRUE(rule.ok());
  EXPECT_DOUBLE_EQ(rule->low_m.x, -0.010);
  EXPECT_DOUBLE_EQ(rule->high_m.x, 0.020);
  EXPECT_EQ(rule->low_m.y, -BoxRule::kOpen);
  EXPECT_EQ(rule->low_m.z, -BoxRule::kOpen);
  EXPECT_DOUBLE_EQ(rule->high_m.z, 0.005);
  EXPECT_TRUE(rule->is_on_surface);
  EXPECT_EQ(*parse_box_rule("all", "--hold"), BoxRule{});
}

TEST(BoxRule, RefusesInOneLineThatNamesOptionAndTerm) {
  for (const char* text : {"", "x", "x=", "x=1", "x=..", "w=1..2", "x=2..1", "x=1..2,x=1..2",
                           "x=nan..1", "x=-3000..1", "x=1..2mm", "top", "x=..1..2", ",x=1..2"}) {
    const auto rule = parse_box_rule(text, "--hold");
    ASSERT_FALSE(rule.ok()) << text;
    EXPECT_EQ(rule.error().code, ErrorCode::Usage);
    EXPECT_EQ(rule.error().message.find('\n'), std::string::npos);
    EXPECT_TRUE(rule.error().message.starts_with("--hold: ")) << rule.error().message;
  }
}

// The lattice has nodes every 10 mm: 30 x 15 x 30.
TEST(BoxRule, TakesTheNodesInTheBox) {
  const auto organ = catalogue::make_lattice();
  const auto all = nodes_in({}, organ.mesh);
  EXPECT_EQ(all.size(), organ.mesh.node_count());
  const auto lowest = nodes_in(*parse_box_rule("y=..-70", "--hold"), organ.mesh);
  EXPECT_EQ(lowest, organ.fixed_nodes);
  const auto box = nodes_in(*parse_box_rule("x=-5..5,y=0..0,z=-15..15", "--hold"), organ.mesh);
  EXPECT_EQ(box.size(), 2u * 1u * 4u);
  EXPECT_TRUE(std::ranges::is_sorted(box));
  EXPECT_TRUE(
      nodes_in(*parse_box_rule("x=-5..5,y=0..0,z=-15..15,surface", "--hold"), organ.mesh).empty());
}

}  // namespace
}  // namespace trocar::edit
