#pragma once

// The numbers of an assessment, one by one, as tables, reports and comparisons show them.

#include <string>
#include <vector>

#include "server/session/assessment/assessment.h"

namespace trocar::assessment {

enum class Better { Less, More, Neither };

struct Figure {
  std::string key;    // with its unit: "peak_force_n"
  std::string words;  // "greatest force"
  std::string unit;   // "N"; empty: it is a count or a ratio
  double value = 0;   // in that unit
  int digits = 2;     // that people are shown
  Better better = Better::Less;
};
std::string text_of(const Figure& figure);  // "2.10 N"

// Returns those of a stage, without what was not measured.
std::vector<Figure> figures_of(const lesson::StageResult& result);
std::vector<Figure> figures_of(const Hand& hand);

// A number of one stage and one hand beside the same of experts.
struct Standing {
  std::size_t stage = 0;  // of the lesson
  std::optional<ToolSlot> tool;
  std::string key;
  double median = 0;      // of the experts, in the key's unit
  double percentile = 0;  // share of experts who are not as good, those who are equal by half
  std::size_t experts = 0;
};
// Stages meet by their number, and hands by their tool. Error: an expert's session gave another
// lesson.
Result<std::vector<Standing>> compare(const Assessment& session,
                                      const std::vector<Assessment>& experts);

}  // namespace trocar::assessment
