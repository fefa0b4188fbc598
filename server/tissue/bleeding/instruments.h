#pragma once

// Finds what the tools of a frame do to blood and to what bleeds, by form, verb and force.

#include <span>
#include <vector>

#include "common/base/ids.h"
#include "common/math/vec3.h"
#include "common/tool/tool.h"

namespace trocar::bleeding {

// A tool that is not silent and has not appeared inside tissue.
struct ToolAtWork {
  ToolSlot tool;
  tool::ToolShape shape;
  tool::Verb verb = tool::Verb::None;
  Vec3d tip_m;         // where the tissue lets it be
  double force_n = 0;  // of the tissue on it
};

// All reaches are from the tip, m.
struct Press {
  Vec3d tip_m;
  double reach_m = 0;
  double pressure_pa = 0;
};
struct Touch {
  Vec3d tip_m;
  double reach_m = 0;
  std::uint8_t tool = 0;
};

struct Instruments {
  std::vector<Press> presses;
  std::vector<Touch> suctions, coagulators, clippers;  // those that are used now

  void read(std::span<const ToolAtWork> tools);
  // True: something presses there with at least this.
  bool is_pressed(const Vec3d& place_m, double pressure_pa) const;
  bool is_coagulated(const Vec3d& place_m) const;
};

}  // namespace trocar::bleeding
