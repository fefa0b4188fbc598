#pragma once

// A hand feels this at once, before the server confirms it: a stop where the tool may not go.

#include "common/math/vec3.h"

namespace trocar::haptics {

// A stiff, damped stop from the place where the tool was when the server refused to let it in. The
// server's own force would be that of a stiff face under a hand of long ago.
class LocalStop {
 public:
  static constexpr double kDamping_s = 0.002;  // over the stiffness
  static constexpr double kBlend_s = 0.015;    // until it damps fully

  bool is_on() const { return is_on_; }
  // `depth_m`: how deep the tool is. `normal_n`: the force there, which the stop takes over.
  void begin(const Vec3d& core_m, const Vec3d& normal, double depth_m, double normal_n,
             double stiffness_n_m);
  void end() { is_on_ = false; }
  // Returns the force along the normal; 0 above the surface.
  double step(const Vec3d& core_m, const Vec3d& velocity_m_s, double dt_s);
  const Vec3d& normal() const { return normal_; }
  double stiffness_n_m() const { return stiffness_n_m_; }

 private:
  bool is_on_ = false;
  Vec3d core_m_, normal_;
  double depth_m_ = 0, normal_n_ = 0, stiffness_n_m_ = 0, damping_share_ = 0;
};

}  // namespace trocar::haptics
