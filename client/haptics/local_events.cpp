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

double CutDrop::step(double force_n, double cut_force_n, double answer_s, std::uint64_t time_us) {
  const double dt_s = last_us_ == 0 ? 0 : static_cast<double>(time_us - last_us_) * 1e-6;
  last_us_ = time_us;
  const bool is_over = cut_force_n > 0 && force_n > cut_force_n;
  if (!is_over) is_armed_ = true;
  if (!is_on_ && is_over && is_armed_) {
    is_on_ = true;
    is_armed_ = false;
    since_us_ = time_us;
  }
  if (is_on_) {
    const double since_s = static_cast<double>(time_us - since_us_) * 1e-6;
    share_ = std::clamp(1 - since_s / kDrop_s, kLeft, 1.0);
    if (since_s > answer_s + kPatience_s) is_on_ = false;
  } else {
    share_ += (1 - share_) * std::min(1.0, dt_s / kReturn_s);
  }
  return share_;
}

void CutDrop::confirm() {
  is_on_ = false;
  share_ = 1;
}

}  // namespace trocar::haptics
