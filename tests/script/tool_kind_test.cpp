#include "common/tool/tool_kind.h"

#include <gtest/gtest.h>

#include <set>

namespace trocar::tool {
namespace {

TEST(ToolKinds, ArePossibleAndToldApart) {
  std::set<std::string_view> names;
  for (const auto& kind : tool_kinds()) {
    EXPECT_TRUE(is_valid(kind.shape)) << kind.name;
    EXPECT_TRUE(names.insert(kind.name).second) << kind.name;
    EXPECT_FALSE(kind.text.empty()) << kind.name;
    EXPECT_EQ(find_tool_kind(kind.name), &kind);
    EXPECT_NE(kind.gripper_verb, Verb::None) << kind.name;
    EXPECT_NE(kind.button_verb, Verb::None) << kind.name;
  }
  EXPECT_EQ(names.size(), 5u);
  EXPECT_EQ(find_tool_kind("spoon"), nullptr);
  EXPECT_EQ(tool_kinds().front().shape, ToolShape{}) << "what has always been";
}

TEST(ToolKinds, DoWhatTheirNamesSay) {
  const auto does = [](std::string_view name, Verb verb) {
    const auto* kind = find_tool_kind(name);
    return kind->gripper_verb == verb && kind->button_verb == verb;
  };
  EXPECT_TRUE(does("probe", Verb::Push));
  EXPECT_TRUE(does("grasper", Verb::Grasp));
  EXPECT_TRUE(does("scalpel", Verb::Cut));
  EXPECT_TRUE(does("hook", Verb::Grasp));
  EXPECT_LT(find_tool_kind("hook")->shape.grip_n, find_tool_kind("grasper")->shape.grip_n);
  EXPECT_LT(find_tool_kind("scalpel")->shape.radius_m, find_tool_kind("probe")->shape.radius_m);
}

}  // namespace
}  // namespace trocar::tool
