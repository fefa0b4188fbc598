#pragma once

// Contact that presses by a spring and rubs by Coulomb's law. Friction has a small elastic range,
// so that what rests stays at rest: the slip beyond what it holds is lost.

#include <algorithm>

#include "common/math/vec3.h"
#include "server/tissue/thread/blocks.h"

namespace trocar::thread {

inline constexpr double kPressN_m = 4e4;            // stiffness of contact
inline constexpr double kRubN_m = 0.5 * kPressN_m;  // of friction's elastic range

struct Rub {
  double press_n = 0;
  Vec3d force_n;    // on the one that the normal points to
  Block stiffness;  // for a solver: what the force loses by a move
};

// slip_m: elastic slip so far, and that of this step. The part along the normal does not count.
inline Rub rub(const Vec3d& normal, double press_n, double friction, const Vec3d& slip_m) {
  Rub rub;
  rub.press_n = press_n;
  const Vec3d across = slip_m - normal * dot(normal, slip_m);
  const double slip = length(across), most_n = friction * press_n;
  const double hold_n_m = kRubN_m * slip > most_n ? most_n / slip : kRubN_m;
  rub.force_n = normal * rub.press_n - across * hold_n_m;
  rub.stiffness = uniaxial(normal, kPressN_m, hold_n_m);
  return rub;
}

// Returns what of the slip friction holds.
inline Vec3d held_slip(const Vec3d& normal, double press_n, double friction, const Vec3d& slip_m) {
  const Vec3d across = slip_m - normal * dot(normal, slip_m);
  const double slip = length(across), most_m = friction * press_n / kRubN_m;
  return slip > most_m ? across * (most_m / slip) : across;
}

}  // namespace trocar::thread
