#include "common/lesson/advice.h"

#include <gtest/gtest.h>

#include "common/lesson/lesson_texts.h"

namespace trocar::lesson {
namespace {

using Lines = std::vector<std::string>;

std::vector<std::string> advice_after(const char* title, const char* stage, bool is_reached,
                                      const Lines& lines) {
  const Lesson* lesson = find_by_title(title);
  if (lesson == nullptr) return {"there is no such lesson"};
  const ToldResult result{stage, is_reached, lines};
  return advice_on(*lesson, {&result, 1});
}

TEST(Advice, IsAboutWhatCostsTheMostPointsFirst) {
  // The greatest force has lost three fifths of its points, the time above the limit half.
  EXPECT_EQ(
      advice_after("Lift the edge gently", "Grasp and lift", true,
                   {"time: 20.2 s", "greatest force: 3.80 N", "time with too much force: 4.8 s",
                    "way of all tips: 0.15 m", "refused or lost grasps: 0"}),
      (Lines{"Use less force: never more than 2 N.", "Let go sooner when the force is too much.",
             "Be quicker: 15 s bring all points."}));
}

TEST(Advice, OfAGoalThatWasNotReachedIsItsHint) {
  const auto advice = advice_after("Find the lump", "Search", false,
                                   {"time: 240.0 s", "wrong answers: 3", "greatest force: 1.00 N"});
  ASSERT_EQ(advice.size(), 3u);
  EXPECT_EQ(advice[0],
            "Search: The lump lies in the left half of the organ, on the side towards you.");
  EXPECT_EQ(advice[2], "Feel twice before you answer.");
}

TEST(Advice, PraisesWhereNothingCostPoints) {
  EXPECT_EQ(advice_after("Find the lump", "Search", true,
                         {"time: 12.0 s", "wrong answers: 0", "greatest force: 1.00 N"}),
            Lines{"Nothing cost you points: try the next lesson."});
}

TEST(Advice, ReadsNoWordsThatAreNoResults) {
  EXPECT_EQ(find_by_title("Another lesson"), nullptr);
  EXPECT_EQ(advice_after("Find the lump", "Search", true, {"greatest force: much", "time", ""}),
            Lines{"Nothing cost you points: try the next lesson."});
}

// Each measure that costs points in a lesson has a sentence, and each stage of them is found.
TEST(Advice, KnowsAllLessonsThatTheProgramsBring) {
  for (const auto& each : lesson_texts()) {
    const auto lesson = read_lesson_text(each.text, each.name);
    ASSERT_TRUE(lesson.ok()) << each.name;
    ASSERT_NE(find_by_title(lesson->title), nullptr) << each.name;
    for (const auto& stage : lesson->stages) {
      Lines lines;
      for (const auto& score : stage.scores)
        lines.push_back(std::string(words_of(score.measure)) + ": " + std::to_string(score.none));
      const ToldResult result{stage.name, true, lines};
      EXPECT_EQ(advice_on(*lesson, {&result, 1}).size(), std::min(kMostAdvice, stage.scores.size()))
          << each.name << ": " << stage.name;
    }
  }
}

}  // namespace
}  // namespace trocar::lesson
