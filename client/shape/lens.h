#pragma once

// This is the view of who sees with a tool: through an endoscope, or from behind the tip of any
// other instrument.

#include "common/math/frame.h"
#include "common/tool/tool.h"

namespace trocar::shape {

struct Lens {
  Vec3f eye;          // m, world frame
  Vec3f forward, up;  // unit
  float tan_half_height = 0;
  bool is_endoscope = false;  // its picture is round, and its light comes from the eye
};

// An endoscope's picture stays upright while the shaft turns, as the hand at the camera's head
// keeps it so; with 30 degrees it then looks another way. `up` of the world is y.
Lens lens_of(const Pose& world_from_tool, const tool::ToolShape& shape);

}  // namespace trocar::shape
