#include "client/device/rate_control.h"

#include <algorithm>
#include <cmath>

namespace trocar::device {
namespace {

constexpr std::uint64_t kLongestStepUs = 50'000;

}  // namespace

double deflection(double value, double full, double dead_zone) {
  const double share = std::clamp(value / full, -1.0, 1.0);
  if (!(std::abs(share) > dead_zone)) return 0;
  return std::copysign((std::abs(share) - dead_zone) / (1 - dead_zone), share);
}

void RateControl::advance(std::uint64_t now_us, const Vec3d& velocity_m_s,
                          const Vec3d& turn_rad_s) {
  if (last_us_ == 0) last_us_ = now_us;
  if (now_us <= last_us_) return;
  const double dt = static_cast<double>(std::min(now_us - last_us_, kLongestStepUs)) * 1e-6;
  last_us_ = now_us;
  const Vec3d before = reading_.position_m;
  const auto within = [&](double x) { return std::clamp(x, -kStickReachM, kStickReachM); };
  const Vec3d wanted = before + velocity_m_s * dt;
  reading_.position_m = {within(wanted.x), within(wanted.y), within(wanted.z)};
  reading_.velocity_m_s = (reading_.position_m - before) / dt;
  // This is right to first order: at 1.5 rad/s and 50 ms it is out by 0.2 %.
  const Vec3f half = to_float(turn_rad_s * (dt / 2));
  reading_.orientation = normalized(Quatf{half.x, half.y, half.z, 1} * reading_.orientation);
}

}  // namespace trocar::device
