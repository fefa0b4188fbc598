#include "client/haptics/slope_fit.h"

#include <algorithm>
#include <cmath>

namespace trocar::haptics {
namespace {

// Force and prior weigh the same at this variance.
constexpr double kPriorVariance_n2 = 0.02 * 0.02;
constexpr double kLeastRestartForce_n = 0.02;

}  // namespace

void SlopeFit::clear_sums() {
  weight_ = local_local_ = local_server_ = share_ = 0;
  local_ = server_ = across_ = local_across_ = lean_ = {};
}

void SlopeFit::add(const Vec3d& server_n, const Vec3d& local_n, double dt_s,
                   std::optional<double> prior) {
  share_ = 0;
  if (length(local_n) < kLeastForce_n) return;
  const double keep = std::exp(-dt_s / forget_s_), take = 1 - keep;
  share_ = take;
  weight_ = keep * weight_ + take;
  local_ = local_ * keep + local_n * take;
  server_ = server_ * keep + server_n * take;
  local_local_ = keep * local_local_ + take * dot(local_n, local_n);
  local_server_ = keep * local_server_ + take * dot(local_n, server_n);
  const double weight = std::max(weight_, 1e-6);
  const Vec3d mean_local = local_ / weight, mean_server = server_ / weight;
  const double variance = std::max(0.0, local_local_ / weight - dot(mean_local, mean_local));
  const double covariance = local_server_ / weight - dot(mean_local, mean_server);
  const double target =
      (covariance + kPriorVariance_n2 * prior.value_or(slope_)) / (variance + kPriorVariance_n2);
  slope_ += (target - slope_) * (1 - std::exp(-dt_s / follow_s_));
  slope_ = std::clamp(slope_, kLeast, kMost);
}

void SlopeFit::add_lean(const Vec3d& server_n, double local_n) {
  if (share_ == 0) return;
  across_ = across_ * (1 - share_) + server_n * share_;
  local_across_ = local_across_ * (1 - share_) + server_n * (local_n * share_);
  const double weight = std::max(weight_, 1e-6), mean = local_.x / weight;
  const double variance = std::max(0.0, local_local_ / weight - mean * mean);
  const Vec3d covariance = local_across_ / weight - across_ * (mean / weight);
  lean_ = covariance / (variance + kPriorVariance_n2);
  const double most = kMostLean * slope_;
  if (length(lean_) > most) lean_ *= most / length(lean_);
}

void SlopeFit::restart(const Vec3d& server_n, const Vec3d& local_n) {
  if (length(local_n) > kLeastRestartForce_n)
    slope_ = std::clamp(dot(server_n, local_n) / dot(local_n, local_n), kLeast, kMost);
  clear_sums();
}

}  // namespace trocar::haptics
