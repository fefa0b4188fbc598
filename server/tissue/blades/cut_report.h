#pragma once

#include <cstdint>

namespace trocar::blades {

// This report says what blades did in one tick.
struct CutReport {
  std::uint32_t crossed_tets = 0, splits = 0;
  double opened_area_m2 = 0;  // one side of the wound
  double torn_area_m2 = 0;    // part of it
  bool is_behind = false;     // work is left for later ticks
  bool is_full = false;       // the surface has as many triangles as may be: blades are blunt
};

}  // namespace trocar::blades
