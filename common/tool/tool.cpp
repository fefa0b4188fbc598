#include "common/tool/tool.h"

#include <array>
#include <cstddef>

namespace trocar::tool {

const char* name_of(Verb verb) {
  switch (verb) {
    case Verb::None:
      return "none";
    case Verb::Push:
      return "push";
    case Verb::Grasp:
      return "grasp";
    case Verb::Cut:
      return "cut";
  }
  return "unknown";
}

const char* name_of(Form form) {
  static constexpr std::array kNames{"plain",        "probe",   "grasper", "scissors",
                                     "scalpel",      "hook",    "spatula", "endoscope",
                                     "endoscope-30", "suction", "clipper", "coagulator"};
  static_assert(kNames.size() == kFormCount);
  const auto number = static_cast<std::size_t>(form);
  return number < kNames.size() ? kNames[number] : "unknown";
}

bool is_valid(const ToolShape& shape) {
  const auto is_none_or = [](float value, float least, float most) {
    return value == 0 || (value >= least && value <= most);
  };
  // Written so that NaN fails.
  return shape.radius_m >= 0.0005f && shape.radius_m <= 0.05f && shape.length_m >= 0.01f &&
         shape.length_m <= 1.0f && shape.reach_m >= 0.001f && shape.reach_m <= 0.05f &&
         shape.half_width_m >= 0 && shape.half_width_m <= 0.05f && shape.friction >= 0 &&
         shape.friction <= 2 && is_none_or(shape.grip_n, 0.1f, 100) &&
         is_none_or(shape.edge_m, 0.001f, 0.2f) && static_cast<int>(shape.form) < kFormCount;
}

Verb main_verb(const ToolShape& shape) {
  if (shape.form == Form::Plain) return Verb::Push;
  if (shape.edge_m > 0) return Verb::Cut;
  return shape.grip_n > 0 ? Verb::Grasp : Verb::Push;
}

Verb possible(const ToolShape& shape, Verb wanted) {
  const bool is_missing =
      (wanted == Verb::Grasp && shape.grip_n == 0) || (wanted == Verb::Cut && shape.edge_m == 0);
  return is_missing ? Verb::Push : wanted;
}

}  // namespace trocar::tool
