// Two recordings on one time: from the start of each, and stage by stage.

#include "client/replay/aligned_time.h"

#include <gtest/gtest.h>

namespace trocar::replay {
namespace {

RecordedStage stage(Tick tick, std::uint32_t number, const char* name = "Search",
                    const char* title = "Lesson") {
  RecordedStage told{.tick = tick, .stage = {}};
  told.stage.set_title(title);
  told.stage.set_stages(3);
  told.stage.set_stage(number);
  told.stage.set_name(name);
  told.stage.set_begin_tick(tick);
  return told;
}

RecordedStage over(Tick tick) {
  auto told = stage(tick, 2);
  told.stage.set_is_over(true);
  return told;
}

// Time goes on in both as much as there is of them, never back, and the inverse holds.
void expect_sound(const AlignedTime& time, const AlignedTime::Spans& spans) {
  for (std::size_t i = 0; i < kPair; ++i) {
    Tick before = spans[i].first;
    for (Tick t = 0; t <= time.last(); t += 7) {
      const auto place = time.place_in(i, t);
      EXPECT_GE(place.tick, before) << t;
      EXPECT_LE(place.tick - before, 7u) << t;
      EXPECT_LE(place.tick, spans[i].last);
      if (!place.is_waiting) {
        const Tick again = time.time_of(i, place.tick);
        EXPECT_EQ(time.place_in(i, again).tick, place.tick);
        EXPECT_GE(again, t);
      }
      before = place.tick;
    }
    EXPECT_EQ(time.place_in(i, time.last()).tick, spans[i].last);
  }
}

TEST(AlignedTime, FromTheStartTheShorterOneEndsFirst) {
  const AlignedTime::Spans spans{{{100, 1100}, {0, 400}}};
  const auto time = AlignedTime::from_start(spans);
  EXPECT_EQ(time.last(), 1000u);
  EXPECT_EQ(time.place_in(0, 0).tick, 100u);
  EXPECT_EQ(time.place_in(0, 500).tick, 600u);
  EXPECT_EQ(time.place_in(1, 400).tick, 400u);
  EXPECT_FALSE(time.place_in(1, 400).has_ended);
  EXPECT_EQ(time.place_in(1, 401).tick, 400u);
  EXPECT_TRUE(time.place_in(1, 401).has_ended);
  expect_sound(time, spans);
}

TEST(AlignedTime, StagesBeginTogetherAndTheFasterOneWaits) {
  const AlignedTime::Spans spans{{{0, 1000}, {0, 1000}}};
  const std::vector<RecordedStage> first{stage(100, 0), stage(300, 1, "Cut"), over(400)};
  const std::vector<RecordedStage> second{stage(50, 0), stage(150, 1, "Cut"), over(600)};
  const auto time = AlignedTime::by_stage(spans, {first, second});
  ASSERT_TRUE(time);
  // 100 before it, 200 and 450 in the two stages, 600 after the lesson.
  EXPECT_EQ(time->last(), 100u + 200 + 450 + 600);
  EXPECT_EQ(time->place_in(0, 100).tick, 100u);
  EXPECT_EQ(time->place_in(1, 100).tick, 50u);
  EXPECT_TRUE(time->place_in(1, 60).is_waiting);
  EXPECT_FALSE(time->place_in(1, 60).has_ended);
  EXPECT_EQ(time->place_in(0, 300).tick, 300u);
  EXPECT_EQ(time->place_in(1, 300).tick, 150u);
  EXPECT_TRUE(time->place_in(0, 500).is_waiting) << "its stage took 100";
  EXPECT_EQ(time->place_in(0, 500).tick, 399u) << "the next has not begun";
  EXPECT_EQ(time->place_in(0, 750).tick, 400u);
  EXPECT_EQ(time->place_in(1, 750).tick, 600u);
  EXPECT_TRUE(time->place_in(1, 1200).has_ended);
  expect_sound(*time, spans);
}

TEST(AlignedTime, OfALessonThatBeganAgainTheLastAttemptCounts) {
  const AlignedTime::Spans spans{{{0, 1000}, {0, 1000}}};
  const std::vector<RecordedStage> first{stage(100, 0), stage(200, 1, "Cut"), stage(500, 0)};
  const std::vector<RecordedStage> second{stage(300, 0), stage(400, 0)};
  const auto time = AlignedTime::by_stage(spans, {first, second});
  ASSERT_TRUE(time);
  EXPECT_EQ(time->place_in(0, time->time_of(1, 400)).tick, 500u);
  expect_sound(*time, spans);
}

TEST(AlignedTime, WithoutAStageInCommonThereIsNone) {
  const AlignedTime::Spans spans{{{0, 1000}, {0, 1000}}};
  const std::vector<RecordedStage> first{stage(100, 0), over(200)};
  const std::vector<std::vector<RecordedStage>> others{
      {}, {stage(100, 0, "Cut")}, {stage(100, 0, "Search", "Other lesson"), over(200)}};
  for (const auto& second : others) EXPECT_FALSE(AlignedTime::by_stage(spans, {first, second}));
}

TEST(AlignedTime, StagesThatAreNotWithinTheRecordingDoNotTurnTimeBack) {
  const AlignedTime::Spans spans{{{200, 1000}, {0, 500}}};
  const std::vector<RecordedStage> first{stage(100, 0), stage(5000, 1, "Cut")};
  const std::vector<RecordedStage> second{stage(450, 0), stage(480, 1, "Cut")};
  const auto time = AlignedTime::by_stage(spans, {first, second});
  ASSERT_TRUE(time);
  expect_sound(*time, spans);
}

}  // namespace
}  // namespace trocar::replay
