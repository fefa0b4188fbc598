#include "common/tool/tool.h"

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

bool is_valid(const ToolShape& shape) {
  // Written so that NaN fails.
  return shape.radius_m >= 0.0005f && shape.radius_m <= 0.05f && shape.length_m >= 0.01f &&
         shape.length_m <= 1.0f && shape.reach_m >= 0.001f && shape.reach_m <= 0.05f &&
         shape.half_width_m >= 0 && shape.half_width_m <= 0.05f && shape.friction >= 0 &&
         shape.friction <= 2 && shape.grip_n >= 0.1f && shape.grip_n <= 100 &&
         shape.edge_m >= 0.001f && shape.edge_m <= 0.2f;
}

}  // namespace trocar::tool
