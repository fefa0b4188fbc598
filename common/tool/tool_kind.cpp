#include "common/tool/tool_kind.h"

#include <algorithm>

namespace trocar::tool {
namespace {

constexpr std::array kKinds{
    ToolKind{.name = "all",
             .text = "the gripper grasps, the second button cuts",
             .shape = {},
             .gripper_verb = Verb::Grasp,
             .button_verb = Verb::Cut},
    ToolKind{.name = "probe",
             .text = "a smooth ball of 10 mm that only presses",
             .shape = {.radius_m = 0.005f, .friction = 0.05f}},
    ToolKind{.name = "grasper",
             .text = "jaws that hold to 8 N; gripper or second button",
             .shape = {.radius_m = 0.0025f, .reach_m = 0.010f, .friction = 0.3f, .grip_n = 8},
             .gripper_verb = Verb::Grasp,
             .button_verb = Verb::Grasp},
    ToolKind{.name = "scalpel",
             .text = "an edge of 15 mm; gripper or second button cuts",
             .shape = {.radius_m = 0.0015f, .friction = 0.1f, .edge_m = 0.015f},
             .gripper_verb = Verb::Cut,
             .button_verb = Verb::Cut},
    ToolKind{.name = "hook",
             .text = "takes a little tissue and pulls it, to 2 N; gripper or second button",
             .shape = {.radius_m = 0.002f, .reach_m = 0.006f, .friction = 0.3f, .grip_n = 2},
             .gripper_verb = Verb::Grasp,
             .button_verb = Verb::Grasp},
};

}  // namespace

std::span<const ToolKind> tool_kinds() {
  return kKinds;
}

const ToolKind* find_tool_kind(std::string_view name) {
  const auto* found = std::ranges::find(kKinds, name, &ToolKind::name);
  return found == kKinds.end() ? nullptr : found;
}

}  // namespace trocar::tool
