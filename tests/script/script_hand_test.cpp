#include "client/device/script_hand.h"

#include <gtest/gtest.h>

namespace trocar::device {
namespace {

const std::vector<Vec3f> kPositions{
    {-0.1f, 0, -0.1f}, {0.1f, 0, -0.1f}, {0, 0, 0.2f}, {0, 0.2f, 0}};
const std::vector<tool::SurfaceTriangle> kTriangles{{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}};

tool::Script parsed(const char* text) {
  auto script = tool::parse_script_text(text, "a.toml");
  TROCAR_ASSERT(script.ok());
  return std::move(*script);
}

TEST(ScriptHand, EachToolIsAtItsOwnAnchor) {
  const auto hand = ScriptHand::make(parsed(R"(
[[tool]]
radius_mm = 3
anchor = [0, 1, 0]
anchor_on = "extreme"
[[tool.key]]
time_s = 0
position_mm = [0, 10, 0]
verb = "push"
[[tool]]
[[tool.key]]
time_s = 0
position_mm = [0, 10, 0]
)"),
                                     kPositions, kTriangles);
  ASSERT_TRUE(hand.ok()) << hand.error().message;
  ASSERT_EQ(hand->tool_count(), 2u);
  EXPECT_FLOAT_EQ(hand->shapes()[0].radius_m, 0.003f);
  EXPECT_NEAR(hand->sample(0, 5).world_from_tool.position.y, 0.21, 1e-6);
  EXPECT_EQ(hand->sample(0, 5).verb, tool::Verb::Push);
  EXPECT_NEAR(hand->sample(1, 5).world_from_tool.position.y, 0.01, 1e-6);
}

TEST(ScriptHand, AKeyOutOfReachOnThisOrganIsRefusedByName) {
  const char* text = R"(
[[tool]]
anchor = [0, 1, 0]
anchor_on = "extreme"
[[tool.key]]
time_s = 0
position_mm = [0, 0, 0]
[[tool.key]]
time_s = 1
position_mm = [0, 1900, 0]
)";
  const auto hand = ScriptHand::make(parsed(text), kPositions, kTriangles);
  ASSERT_FALSE(hand.ok());
  EXPECT_NE(hand.error().message.find("a.toml: key tool[0].key[1].position_mm"), std::string::npos)
      << hand.error().message;
}

TEST(ScriptHand, AnOrganWithoutSurfaceIsRefused) {
  const auto hand = ScriptHand::make(
      parsed("[[tool]]\nanchor = [0, 1, 0]\n[[tool.key]]\ntime_s = 0\nposition_mm = [0, 0, 0]\n"),
      kPositions, {});
  ASSERT_FALSE(hand.ok());
  EXPECT_NE(hand.error().message.find("anchor"), std::string::npos);
}

}  // namespace
}  // namespace trocar::device
