#include "client/replica/held_tissue.h"

#include <gtest/gtest.h>

namespace trocar::replica {
namespace {

// A sheet of 21 x 21 vertices, 5 mm apart, in the plane y = 0.
std::vector<Vec3f> sheet() {
  std::vector<Vec3f> positions;
  for (int i = -10; i <= 10; ++i)
    for (int j = -10; j <= 10; ++j)
      positions.push_back({0.005f * static_cast<float>(i), 0, 0.005f * static_cast<float>(j)});
  return positions;
}

Tool tool_of(int slot, tool::Verb verb, const Vec3f& tip) {
  Tool tool;
  tool.slot.value = static_cast<std::uint8_t>(slot);
  tool.verb = verb;
  tool.has_claim = true;
  tool.world_from_tool = {tip, rotation_from_z({0, 1, 0})};
  tool.world_from_proxy = tool.world_from_tool;
  return tool;
}

class HeldTissueTest : public ::testing::Test {
 protected:
  int count(int owner, bool is_grasp) const {
    int sum = 0;
    for (const Holding& holding : held_.holdings())
      sum += holding.owner == owner && holding.is_grasp == is_grasp;
    return sum;
  }
  void update(std::vector<Tool> tools) {
    held_.update(positions_, tools, std::vector<tool::ToolShape>(tools.size(), shape_));
  }

  std::vector<Vec3f> positions_ = sheet();
  tool::ToolShape shape_{.radius_m = 0.004f, .length_m = 0.1f, .reach_m = 0.011f};
  HeldTissue held_;
};

TEST_F(HeldTissueTest, AGraspKeepsWhatItTookUntilItEnds) {
  update({tool_of(4, tool::Verb::Grasp, {0, 0, 0})});
  EXPECT_EQ(count(2, true), 13);  // within 11 mm on a grid of 5 mm
  const auto before = held_.holdings();
  for (Vec3f& p : positions_) p += Vec3f{0, 0.03f, 0.04f};  // all of it is carried along
  update({tool_of(4, tool::Verb::Grasp, {0, 0.03f, 0.04f})});
  EXPECT_EQ(held_.holdings(), before);
  auto released = tool_of(4, tool::Verb::Grasp, {0, 0.03f, 0.04f});
  released.has_claim = false;
  update({released});
  EXPECT_EQ(count(2, true), 0);
  // A new grasp takes what is there now.
  update({tool_of(4, tool::Verb::Grasp, {0, 0.03f, 0.04f})});
  EXPECT_EQ(held_.holdings(), before);
}

TEST_F(HeldTissueTest, WhatComesOutOfTheJawsIsNotHeld) {
  update({tool_of(4, tool::Verb::Grasp, {0, 0, 0})});
  update({tool_of(4, tool::Verb::Grasp, {0.012f, 0, 0})});
  EXPECT_GT(count(2, true), 0);
  EXPECT_LT(count(2, true), 13);
  update({tool_of(4, tool::Verb::Grasp, {0.05f, 0, 0})});
  EXPECT_EQ(count(2, true), 0);
}

TEST_F(HeldTissueTest, APushTouchesWhatLiesUnderItsSolidAndAGraspGoesFirst) {
  update({tool_of(1, tool::Verb::Push, {0, 0.001f, 0})});
  EXPECT_EQ(count(0, false), 5);
  shape_.half_width_m = 0.02f;  // flat, across x
  update({tool_of(1, tool::Verb::Push, {0, 0.001f, 0})});
  EXPECT_GT(count(0, false), 20);
  shape_.half_width_m = 0;
  update({tool_of(1, tool::Verb::Push, {0, 0.001f, 0}), tool_of(4, tool::Verb::Grasp, {0, 0, 0})});
  EXPECT_EQ(count(0, false), 0);
  EXPECT_EQ(count(2, true), 13);
  update({});
  EXPECT_EQ(count(2, true), 0);
}

TEST_F(HeldTissueTest, AnotherSurfaceForgetsWhatWasHeldOnTheOld) {
  update({tool_of(4, tool::Verb::Grasp, {0, 0, 0})});
  positions_.resize(7);
  update({tool_of(4, tool::Verb::Grasp, {0, 0, 0})});
  EXPECT_EQ(held_.holdings().size(), 7u);
  held_.clear();
  EXPECT_TRUE(held_.holdings().empty());
}

}  // namespace
}  // namespace trocar::replica
