#pragma once

// The instruments that a hand on a device can hold: a shape, and what its grip and its button ask
// of the tissue. What each feels like follows from both: a wide tip is stiffer than a thin one,
// jaws hold, an edge parts what it meets.

#include <array>
#include <span>
#include <string_view>

#include "common/tool/tool.h"

namespace trocar::tool {

struct ToolKind {
  std::string_view name;
  std::string_view text;  // one line for people
  ToolShape shape;
  Verb gripper_verb = Verb::Push,
       button_verb = Verb::Push;  // closed; pressed. Push: it does nothing
};

// The first one is what a device holds if nothing is said.
std::span<const ToolKind> tool_kinds();
// Null: there is no such kind.
const ToolKind* find_tool_kind(std::string_view name);

}  // namespace trocar::tool
