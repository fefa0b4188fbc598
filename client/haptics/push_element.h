#pragma once

// Local tissue under one tip: a force along the surface's normal, and across it friction that
// sticks to an anchor until Coulomb's limit, then drags the anchor along.

#include <algorithm>

#include "client/haptics/power_law.h"
#include "client/haptics/visco_element.h"
#include "common/math/vec3.h"

namespace trocar::haptics {

// How much stiffer tissue is along the normal than across it, measured on the liver.
inline constexpr double kAcrossOverNormal = 0.72;

// Local tissue answers this, before it is scaled to what the server says.
struct Response {
  // Along the outward normal. Relaxed tissue that is let go lags behind: then this is negative.
  double normal_n = 0;
  double elastic_n = 0;      // likewise if nothing relaxed; 0: above the surface
  Vec3d rest_n;              // across the normal; of held tissue all of it
  Vec3d sides_n;             // friction at a blade's sides, which the server has said: never scaled
  double stiffness_n_m = 0;  // elastic, before anything relaxes
};

class PushElement {
 public:
  // Begins at a depth as if it had been pressed there at once, but slowly.
  void start(double depth_m) {
    *this = {};
    depth_m_ = std::max(depth_m, 0.0);
  }

  // `normal`: unit, outward. `friction`: Coulomb's coefficient.
  Response step(const PowerLaw& law, const ViscoSteps& steps, double depth_m, const Vec3d& place_m,
                const Vec3d& normal, double friction);

 private:
  Vec3d across(const PowerLaw& law, const ViscoSteps& steps, const Vec3d& place_m, double limit_n);

  ViscoElement<double> along_;
  ViscoElement<Vec3d> across_;
  double depth_m_ = 0;       // of the last step, 0 above the surface
  Vec3d place_m_, normal_;   // of the last step
  Vec3d anchor_m_, slip_m_;  // slip: from the anchor, in the tangent plane
  bool touches_ = false;
};

}  // namespace trocar::haptics
