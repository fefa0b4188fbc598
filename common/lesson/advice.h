#pragma once

// This says what somebody may do better next time, out of what people are told of a lesson's
// results. It is of the lessons that the programs bring, whose scores are known everywhere.

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/lesson/lesson.h"

namespace trocar::lesson {

inline constexpr double kPassPoints = 60;  // of 100; nobody has checked it against people
inline constexpr std::size_t kMostAdvice = 3;

// A result in words: `lines` as lines_of() writes them.
struct ToldResult {
  std::string_view stage;
  bool is_reached = false;
  std::span<const std::string> lines;
};

// Returns the lesson of this title; null: the programs bring none. Any thread.
const Lesson* find_by_title(std::string_view title);
// Returns the stage of this name; null: there is none.
const Stage* find_stage(const Lesson& lesson, std::string_view name);

// Returns at most kMostAdvice sentences, about what has cost the most points first; one of praise
// if nothing has cost any.
std::vector<std::string> advice_on(const Lesson& lesson, std::span<const ToldResult> results);

}  // namespace trocar::lesson
