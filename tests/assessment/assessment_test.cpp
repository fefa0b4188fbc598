// Measures of constructed recordings, whose answers are known.

#include "server/session/assessment/assessment.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/assessment/recorded_lesson.h"
#include "tests/support/files.h"

namespace trocar::assessment::testing {
namespace {

using lesson::Measure;
using trocar::testing::TemporaryFolder;
using wire::ClaimOutcome;

constexpr ToolSlot kTool{0}, kOther{2};
constexpr float kFrameS = 0.016f;

float seconds_of(Tick tick) {
  return static_cast<float>(tick) * 1e-3f;
}

class Assess : public ::testing::Test {
 protected:
  Assessment assess(const Session& session, const Play& play) {
    const auto path = folder_.file("session.mcap");
    std::filesystem::remove(path);
    record(path, session, play);
    auto assessed = assessment::assess(path, {});
    EXPECT_TRUE(assessed.ok()) << assessed.error().message;
    return assessed.ok() ? std::move(*assessed) : Assessment{};
  }
  const TemporaryFolder folder_;
};

// A straight way at 50 mm/s across a force of 3 N for the last second of four.
TEST_F(Assess, AStraightWayAcrossAForceHasAllItsMeasures) {
  const auto session = assess({}, [](step::PublishedFrame& frame) {
    const float t = seconds_of(frame.tick);
    frame.tools = {tool_at(kTool, {0.05f * t, 0.1f, 0}, {0, 0, t > 3 ? 3.0f : 0.0f})};
  });
  EXPECT_TRUE(session.notes.empty());
  EXPECT_TRUE(session.stages.empty());
  ASSERT_EQ(session.whole.hands.size(), 1u);
  const auto& hand = session.whole.hands[0];
  EXPECT_EQ(hand.person, "Anna");
  EXPECT_EQ(hand.tool, kTool);
  // 250 frames are 249 steps.
  EXPECT_NEAR(hand.skill.seconds, 249 * kFrameS, 1e-6);
  EXPECT_NEAR(hand.skill.path_m, 0.05 * 249 * kFrameS, 1e-6);
  EXPECT_NEAR(hand.skill.economy, 1, 1e-6);
  EXPECT_NEAR(hand.skill.peak_n, 3, 1e-6);
  EXPECT_NEAR(hand.skill.mean_n, 3, 1e-6);
  EXPECT_NEAR(hand.skill.above_limit_s, 1, kFrameS);
  EXPECT_NEAR(hand.skill.idle_s, 0, 1e-9);
  EXPECT_NEAR(hand.skill.work_j, 0, 1e-9);  // the force is across the way
  EXPECT_EQ(session.curves.size(), 1u);
}

// It works against 2 N over 100 mm: 0.2 J.
TEST_F(Assess, WorkIsForceTimesWay) {
  const auto session = assess({}, [](step::PublishedFrame& frame) {
    const float t = seconds_of(frame.tick);
    frame.tools = {tool_at(kTool, {0.025f * t, 0.1f, 0}, {-2, 0, 0})};
  });
  EXPECT_NEAR(session.whole.hands.at(0).skill.work_j, 2 * 0.025 * 249 * kFrameS, 1e-5);
}

TEST_F(Assess, AToolThatIsSilentIsNotThere) {
  const auto session = assess({}, [](step::PublishedFrame& frame) {
    frame.tools = {tool_at(kTool, {0, 0.1f, 0})};
    frame.tools[0].is_silent = frame.tick > 2000;
  });
  EXPECT_NEAR(session.whole.hands.at(0).skill.seconds, 2, 2 * kFrameS);
  EXPECT_NEAR(session.whole.hands.at(0).skill.idle_s, 2, 2 * kFrameS);
}

TEST_F(Assess, CountsWhatBecameOfGraspsAndHowLongAHandWaited) {
  Session two;
  two.names = {"Anna", "Ben"};
  const auto session = assess(two, [](step::PublishedFrame& frame) {
    const bool asks = frame.tick >= 1008 && frame.tick < 3200;
    frame.tools = {tool_at(kTool, {0, 0.1f, 0}, {}, tool::Verb::Grasp, true),
                   tool_at(kOther, {0.1f, 0.1f, 0}, {}, asks ? tool::Verb::Grasp : tool::Verb::None,
                           frame.tick >= 2400)};
    using enum ClaimOutcome;
    if (frame.tick == 16) frame.claim_events = {claim(10, kTool, tool::Verb::Grasp, Granted)};
    if (frame.tick == 1008)
      frame.claim_events = {claim(1000, kOther, tool::Verb::Grasp, RefusedHeld)};
    if (frame.tick == 2400) frame.claim_events = {claim(2400, kOther, tool::Verb::Grasp, Granted)};
    if (frame.tick == 2800) frame.claim_events = {claim(2790, kOther, tool::Verb::Grasp, Slipped)};
    if (frame.tick == 3008)
      frame.claim_events = {claim(3000, kOther, tool::Verb::Grasp, RefusedHeld)};
    if (frame.tick == 3504)
      frame.claim_events = {claim(3500, kTool, tool::Verb::Cut, RefusedNothingInReach)};
  });
  ASSERT_EQ(session.whole.hands.size(), 2u);
  const auto &anna = session.whole.hands[0], &ben = session.whole.hands[1];
  EXPECT_EQ(anna.grasps, 1);
  EXPECT_EQ(anna.refusals, 1);
  EXPECT_EQ(anna.waited_s, 0);
  EXPECT_EQ(ben.person, "Ben");
  EXPECT_EQ(ben.grasps, 1);
  EXPECT_EQ(ben.refusals, 2);
  EXPECT_EQ(ben.losses, 1);
  // From 1000 to 2400, and from 3000 until it asks no more.
  EXPECT_NEAR(ben.waited_s, 1.4 + 0.2, 1e-9);
  ASSERT_EQ(session.whole.moments.size(), 4u);
  EXPECT_EQ(session.whole.moments[0].tick, 1000u);
  EXPECT_EQ(session.whole.moments[0].person, "Ben");
}

TEST_F(Assess, BloodIsACurveOverTime) {
  const auto bled = assess({}, [](step::PublishedFrame& frame) {
    frame.figures.blood.emplace();
    frame.figures.blood->shed_nl = 5'000 * frame.tick;  // 5 ml a second
  });
  const auto& [time_s, lost_ml] = bled.blood;
  ASSERT_EQ(time_s.size(), lost_ml.size());
  ASSERT_NEAR(static_cast<double>(time_s.size()), 16, 1) << "four seconds, four times a second";
  for (std::size_t i = 0; i < time_s.size(); ++i) EXPECT_NEAR(lost_ml[i], 5 * time_s[i], 1e-9);
  EXPECT_TRUE(assess({}, [](step::PublishedFrame&) {}).blood.time_s.empty());
}

// On the point for 1 s with 2 N: reached, and half of the points. The second stage is not over.
TEST_F(Assess, StagesOfALessonAreMeasuredByThemselves) {
  Session session;
  session.lesson = kFollowLesson;
  const auto assessed = assess(session, [](step::PublishedFrame& frame) {
    const bool is_there = frame.tick > 1000 && frame.tick < 2500;
    frame.tools = {
        tool_at(kTool, {is_there ? 0 : 0.1f, 0.2f, 0}, {0, frame.tick == 1600 ? 2.0f : 0.0f, 0})};
  });
  ASSERT_TRUE(assessed.lesson);
  EXPECT_FALSE(assessed.is_over);
  ASSERT_EQ(assessed.stages.size(), 2u);
  const auto& first = assessed.stages[0];
  EXPECT_EQ(first.name, "First");
  ASSERT_TRUE(first.result);
  EXPECT_TRUE(first.result->is_reached);
  EXPECT_NEAR(first.result->points, 50, 1e-6);
  EXPECT_NEAR(assessed.points, 50, 1e-6);
  EXPECT_NEAR(first.seconds(), 2, 2 * kFrameS);
  EXPECT_NEAR(first.result->value(Measure::TimeAbove), kFrameS, 1e-6);
  ASSERT_EQ(first.moments.size(), 1u);
  EXPECT_EQ(first.moments[0].tick, 1600u);
  EXPECT_EQ(first.moments[0].text, "passed the limit of force for 0.0 s, 2.0 N at this moment");
  EXPECT_NEAR(first.hands.at(0).skill.peak_n, 2, 1e-6);
  EXPECT_NEAR(first.hands.at(0).skill.above_limit_s, kFrameS, 1e-6);
  const auto& second = assessed.stages[1];
  EXPECT_FALSE(second.result);
  EXPECT_NEAR(second.hands.at(0).skill.peak_n, 0, 1e-6);
  EXPECT_NEAR(assessed.whole.hands.at(0).skill.peak_n, 2, 1e-6);
}

TEST_F(Assess, OrdersOfTheRecordingCount) {
  Session session;
  session.lesson = kFollowLesson;
  session.inputs.resize(2);
  session.inputs[0].set_tick(800), session.inputs[0].set_action(proto::LESSON_RESTART);
  session.inputs[1].set_tick(1600), session.inputs[1].set_action(proto::LESSON_NEXT);
  const auto assessed = assess(session, [](step::PublishedFrame& frame) {
    frame.tools = {tool_at(kTool, {0.1f, 0.2f, 0})};
  });
  ASSERT_EQ(assessed.stages.size(), 2u);
  EXPECT_EQ(assessed.stages[0].begin, 800u);
  EXPECT_EQ(assessed.stages[0].end, 1600u);
  EXPECT_FALSE(assessed.stages[0].result->is_reached);
  EXPECT_EQ(assessed.notes.size(), 1u);  // that it was begun anew
}

TEST_F(Assess, SaysWherePeopleWereToldOfOtherResults) {
  Session session;
  session.lesson = kFollowLesson;
  session.told.resize(1);
  auto& told = *session.told[0].add_result();
  told.set_is_reached(true);
  told.set_points(100);
  const auto play = [](step::PublishedFrame& frame) {
    frame.tools = {tool_at(kTool, {0, 0.2f, 0}, {0, frame.tick == 320 ? 2.0f : 0.0f, 0})};
  };
  session.seconds = 1.5;
  const auto other = assess(session, play);
  ASSERT_EQ(other.notes.size(), 1u);
  EXPECT_NE(other.notes[0].find("people were told"), std::string::npos);
  told.set_points(50);
  session.told[0].set_points(50);
  EXPECT_TRUE(assess(session, play).notes.empty());
}

TEST_F(Assess, PseudonymsStandForTheSameNames) {
  std::vector<Assessment> sessions(2);
  sessions[0].whole.hands = {{.person = "Zoe"}, {.person = "Anna"}};
  sessions[1].whole.hands = {{.person = "Anna"}, {.person = ""}};
  sessions[1].whole.moments = {{.person = "Zoe", .text = "gave a wrong answer"}};
  sessions[1].curves = {{.person = "Ben"}};
  give_pseudonyms(sessions);
  EXPECT_EQ(sessions[0].whole.hands[0].person, "Person 1");
  EXPECT_EQ(sessions[0].whole.hands[1].person, "Person 2");
  EXPECT_EQ(sessions[1].whole.hands[0].person, "Person 2");
  EXPECT_EQ(sessions[1].whole.hands[1].person, "");
  EXPECT_EQ(sessions[1].whole.moments[0].person, "Person 1");
  EXPECT_EQ(sessions[1].curves[0].person, "Person 3");
}

}  // namespace
}  // namespace trocar::assessment::testing
