#include "client/haptics/local_events.h"

#include <algorithm>

namespace trocar::haptics {

void LocalStop::begin(const Vec3d& core_m, const Vec3d& normal, double depth_m, double normal_n,
                      double stiffness_n_m) {
  is_on_ = true;
  core_m_ = core_m;
  normal_ = normal;
  depth_m_ = std::max(depth_m, 0.0);
  normal_n_ = normal_n;
  stiffness_n_m_ = stiffness_n_m;
  damping_share_ = 0;
}

double LocalStop::step(const Vec3d& core_m, const Vec3d& velocity_m_s, double dt_s) {
  damping_share_ += (1 - damping_share_) * std::min(1.0, dt_s / kBlend_s);
  const double deeper_m = -dot(normal_, core_m - core_m_);
  if (depth_m_ + deeper_m <= 0) return 0;
  const double damping_n =
      damping_share_ * kDamping_s * stiffness_n_m_ * -dot(normal_, velocity_m_s);
  return std::max(0.0, normal_n_ + stiffness_n_m_ * deeper_m + damping_n);
}

}  // namespace trocar::haptics
