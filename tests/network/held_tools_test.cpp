// Tools that an instructor holds: what the simulation is given in place of what the hand does.

#include "server/session/participants/held_tools.h"

#include <gtest/gtest.h>

#include <cmath>

namespace trocar::participants {
namespace {

using tool::Verb;

constexpr ParticipantSlot kHand{3};
constexpr std::uint64_t kSampleNs = 8'000'000;

class HeldToolsTest : public ::testing::Test {
 protected:
  std::optional<hands::ToolInput> move(float x, Verb verb = Verb::None, int number = 0) {
    now_ns_ += kSampleNs;
    hands::ToolInput input{tool_slot(kHand, number), {}, now_ns_ / 1000};
    input.sample.world_from_tool.position.x = x;
    input.sample.verb = verb;
    return tools_.apply(input, now_ns_);
  }

  HeldTools tools_;
  std::uint64_t now_ns_ = 1'000'000'000;
};

TEST_F(HeldToolsTest, AFreeToolIsWhereItsHandIs) {
  const auto given = move(0.1f, Verb::Push);
  ASSERT_TRUE(given);
  EXPECT_FLOAT_EQ(given->sample.world_from_tool.position.x, 0.1f);
  EXPECT_EQ(given->sample.verb, Verb::Push);
  EXPECT_EQ(given->client_time_us, now_ns_ / 1000);
}

TEST_F(HeldToolsTest, AFrozenToolKeepsPoseAndVerbAndIsNotFelt) {
  move(0.1f, Verb::Grasp);
  tools_.freeze(kHand);
  EXPECT_TRUE(tools_.is_frozen(kHand));
  for (int i = 1; i <= 50; ++i) {
    const auto given = move(0.1f + 0.01f * static_cast<float>(i), Verb::Cut);
    ASSERT_TRUE(given) << "samples keep the lease alive";
    EXPECT_FLOAT_EQ(given->sample.world_from_tool.position.x, 0.1f);
    EXPECT_EQ(given->sample.verb, Verb::Grasp);
    EXPECT_EQ(given->client_time_us, 0u) << "its hand feels nothing";
  }
}

TEST_F(HeldToolsTest, AToolThatIsNowhereYetStaysSo) {
  tools_.freeze(kHand);
  EXPECT_FALSE(move(0.1f));
  tools_.release(kHand);
  const auto given = move(0.2f);
  ASSERT_TRUE(given);
  EXPECT_FLOAT_EQ(given->sample.world_from_tool.position.x, 0.2f) << "there is no way to come back";
}

TEST_F(HeldToolsTest, AReleasedToolGoesBackSlowlyAndNeitherCutsNorPushesOnTheWay) {
  move(0.0f, Verb::Cut);
  tools_.freeze(kHand);
  move(0.1f, Verb::Cut);
  tools_.release(kHand);
  const float step = kReturnSpeed * 0.008f;
  float before = 0;
  int steps = 0;
  for (; steps < 1000; ++steps) {
    const auto given = move(0.1f, Verb::Cut);
    ASSERT_TRUE(given);
    const float x = given->sample.world_from_tool.position.x;
    EXPECT_LE(x - before, step * 1.001f);
    before = x;
    if (x == 0.1f) {
      EXPECT_EQ(given->sample.verb, Verb::Cut);
      EXPECT_NE(given->client_time_us, 0u);
      break;
    }
    EXPECT_EQ(given->sample.verb, Verb::None);
    EXPECT_EQ(given->client_time_us, 0u);
  }
  EXPECT_NEAR(steps, std::round(0.1f / step), 2);
  EXPECT_FLOAT_EQ(move(0.2f)->sample.world_from_tool.position.x, 0.2f) << "it is free again";
}

TEST_F(HeldToolsTest, ItTurnsBackSlowly) {
  move(0);
  tools_.freeze(kHand);
  tools_.release(kHand);
  hands::ToolInput turned{tool_slot(kHand, 0), {}, 0};
  turned.sample.world_from_tool.orientation = {0, 1, 0, 0};  // half a turn
  now_ns_ += kSampleNs;
  const auto given = tools_.apply(turned, now_ns_);
  ASSERT_TRUE(given);
  const auto& q = given->sample.world_from_tool.orientation;
  const float turn = 2 * std::acos(std::abs(q.w));
  EXPECT_GT(turn, 0.005f);
  EXPECT_LE(turn, kReturnTurn * 0.008f * 1.01f);
}

TEST_F(HeldToolsTest, AGraspIsKeptOnTheWayBackIfTheHandStillHolds) {
  for (const bool still_holds : {true, false}) {
    move(0.0f, Verb::Grasp);
    tools_.freeze(kHand);
    tools_.release(kHand);
    const auto given = move(0.1f, still_holds ? Verb::Grasp : Verb::None);
    EXPECT_EQ(given->sample.verb, still_holds ? Verb::Grasp : Verb::None);
    tools_.forget(kHand);
  }
}

TEST_F(HeldToolsTest, OpenedJawsStayOpenUntilTheHandHasLetGo) {
  move(0.1f, Verb::Grasp, 0);
  move(0.2f, Verb::Cut, 1);
  const auto at_once = tools_.open(kHand);
  ASSERT_EQ(at_once.size(), 2u);
  for (const auto& input : at_once) EXPECT_EQ(input.sample.verb, Verb::None);
  EXPECT_FLOAT_EQ(at_once[1].sample.world_from_tool.position.x, 0.2f);
  EXPECT_EQ(move(0.1f, Verb::Grasp)->sample.verb, Verb::None);
  EXPECT_EQ(move(0.1f, Verb::Cut, 1)->sample.verb, Verb::None);
  move(0.1f, Verb::None);
  EXPECT_EQ(move(0.1f, Verb::Grasp)->sample.verb, Verb::Grasp) << "it may ask again";
  EXPECT_EQ(move(0.1f, Verb::Cut, 1)->sample.verb, Verb::None) << "the other tool has not let go";
}

TEST_F(HeldToolsTest, WhatAFrozenToolHoldsCanBeTaken) {
  move(0.1f, Verb::Grasp);
  tools_.freeze(kHand);
  tools_.open(kHand);
  EXPECT_EQ(move(0.3f, Verb::Grasp)->sample.verb, Verb::None);
  tools_.release(kHand);
  EXPECT_EQ(move(0.3f, Verb::Grasp)->sample.verb, Verb::None);
}

TEST_F(HeldToolsTest, WhoComesNextIsFree) {
  move(0.1f);
  tools_.freeze(kHand);
  tools_.forget(kHand);
  EXPECT_FALSE(tools_.is_frozen(kHand));
  EXPECT_FLOAT_EQ(move(0.4f)->sample.world_from_tool.position.x, 0.4f);
  EXPECT_TRUE(tools_.open({kMaxHands}).empty()) << "who watches has no tools";
}

}  // namespace
}  // namespace trocar::participants
