#pragma once

// The correction of the local model's force by the server's answers (touch_model.h), in use and
// where it goes: c, s, lean, lever and limit. N, m.

#include <algorithm>

#include "client/haptics/slope_fit.h"
#include "common/math/vec3.h"

namespace trocar::haptics {

struct Correction {
  static constexpr double kNoLimit_n = 1e9;

  double slope = 1;                     // behind the fit's
  Vec3d lean;                           // likewise
  Vec3d n, next_n;                      // c, and its target
  double gate_force_n = 0.02;           // at the echo
  double pressed_limit_n = kNoLimit_n;  // along the normal
  Vec3d lever_m, next_lever_m;          // torque over the size of the force

  // Goes a share of the way to the targets.
  void blend(const SlopeFit& fit, double share) {
    slope += (fit.slope() - slope) * share;
    lean += (fit.lean() - lean) * share;
    n += (next_n - n) * share;
    lever_m += (next_lever_m - lever_m) * share;
  }
  // A limit comes from the force that there is, and goes at once; 0: there is none.
  void limit(double limit_n, double force_n, double share) {
    if (limit_n <= 0) {
      pressed_limit_n = kNoLimit_n;
      return;
    }
    pressed_limit_n = std::min(pressed_limit_n, std::max(limit_n, force_n));
    pressed_limit_n += (limit_n - pressed_limit_n) * share;
  }
};

}  // namespace trocar::haptics
