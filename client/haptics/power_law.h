#pragma once

// Force over depth of a round tip pressed into soft tissue, before anything relaxes:
//
//   f = a d^p,   linear below 0.2 mm, so that a first touch has a stiffness
//
// The first guess of `a` has Hertz's stiffness 2 E* sqrt(R d) at a depth of 5 mm, E* = E / (1 -
// nu^2) (Johnson, Contact Mechanics, eq. 4.23). On the measured liver that is within 20 %.

#include "common/wire/haptic_patch.h"

namespace trocar::haptics {

struct PowerLaw {
  static constexpr double kLinearDepth_m = 2e-4;

  double coefficient = 0;  // a, N/m^p
  double exponent = 1.5;   // p

  // It is 0 at and above the surface.
  double force_n(double depth_m) const;
  // Returns the derivative of the force; above the surface that of the first touch.
  double stiffness_n_m(double depth_m) const;
};

PowerLaw first_guess(const wire::HapticLaw& law, double tip_radius_m);

}  // namespace trocar::haptics
