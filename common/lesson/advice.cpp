#include "common/lesson/advice.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <optional>

#include "common/lesson/lesson_texts.h"

namespace trocar::lesson {
namespace {

constexpr double kLeastLoss = 0.05;  // of a score's points: less is nobody's fault

// A sentence for each measure; {} is the value that brings all points, with its unit.
constexpr std::array<std::string_view, kMeasures> kSentences{
    "Be quicker: {} bring all points.",
    "Use less force: never more than {}.",
    "Touch more lightly: {} on average.",
    "Let go sooner when the force is too much.",
    "Plan the way before you move: {} is enough.",
    "Feel twice before you answer.",
    "Be more exact: stay within {}.",
    "Keep the edge on the line.",
    "Leave more healthy tissue around it.",
    "Take out less: {} is enough.",
    "Keep away from what is to be spared.",
    "Grasp where nobody else holds, and pull less.",
    "Stop what bleeds before you go on.",
    "Let go only where it belongs.",
};

// The value of a measure in its unit, as lines_of() has written it.
std::optional<double> told_value(Measure measure, std::span<const std::string> lines) {
  const std::string head = std::string(words_of(measure)) + ": ";
  for (const auto& line : lines) {
    if (!line.starts_with(head)) continue;
    const char* const begin = line.c_str() + head.size();
    char* end = nullptr;
    const double value = std::strtod(begin, &end);
    if (end != begin && std::isfinite(value)) return value;
  }
  return std::nullopt;
}

struct Loss {
  double share = 0;  // of the score's points
  std::string sentence;
};

std::string sentence_on(const Score& score) {
  const std::string unit = unit_of(score.measure);
  const auto full = fmt::format("{:g}", score.full) + (unit.empty() ? "" : " " + unit);
  return fmt::format(fmt::runtime(kSentences[static_cast<std::size_t>(score.measure)]), full);
}

void add_losses(const Stage& stage, const ToldResult& result, std::vector<Loss>& losses) {
  if (!result.is_reached)
    losses.push_back({2, stage.hint.empty() ? stage.name + ": reach the goal first."
                                            : stage.name + ": " + stage.hint});
  for (const Score& score : stage.scores) {
    const auto value = told_value(score.measure, result.lines);
    if (!value) continue;
    const double lost = 1 - score.points(*value);
    if (lost > kLeastLoss) losses.push_back({lost, sentence_on(score)});
  }
}

std::vector<Lesson> read_all() {
  std::vector<Lesson> lessons;
  for (const auto& each : lesson_texts())
    if (auto lesson = read_lesson_text(each.text, each.name)) lessons.push_back(std::move(*lesson));
  return lessons;
}

}  // namespace

const Lesson* find_by_title(std::string_view title) {
  static const std::vector<Lesson> lessons = read_all();
  const auto found = std::ranges::find(lessons, title, &Lesson::title);
  return found == lessons.end() ? nullptr : &*found;
}

const Stage* find_stage(const Lesson& lesson, std::string_view name) {
  const auto found = std::ranges::find(lesson.stages, name, &Stage::name);
  return found == lesson.stages.end() ? nullptr : &*found;
}

std::vector<std::string> advice_on(const Lesson& lesson, std::span<const ToldResult> results) {
  std::vector<Loss> losses;
  for (const auto& result : results)
    if (const Stage* stage = find_stage(lesson, result.stage)) add_losses(*stage, result, losses);
  std::ranges::stable_sort(losses, std::greater{}, &Loss::share);
  std::vector<std::string> advice;
  for (auto& loss : losses)
    if (advice.size() < kMostAdvice && std::ranges::find(advice, loss.sentence) == advice.end())
      advice.push_back(std::move(loss.sentence));
  if (advice.empty()) advice.emplace_back("Nothing cost you points: try the next lesson.");
  return advice;
}

}  // namespace trocar::lesson
