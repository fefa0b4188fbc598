#include "client/haptics/safety.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/wire/hand_report.h"

namespace trocar::haptics {
namespace {

constexpr double kDampedTime_s = 1 / (2 * std::numbers::pi * 40);
constexpr double kLeastStiffness_n_m = 50;
constexpr double kStoreMargin = 1.3;
constexpr double kFreeStore_j = 0.0005;
constexpr double kFree_n = 1e-4;
constexpr double kLeastSpeedSquared = 1e-6;  // m^2/s^2
constexpr double kShortestStep_s = 1e-4;
constexpr double kLongestSlew_s = 0.002;  // a late step may not change the force by more

Vec3d towards(const Vec3d& from, const Vec3d& to, double most) {
  const Vec3d way = to - from;
  const double size = length(way);
  return size > most ? from + way * (most / size) : to;
}

}  // namespace

static_assert(kLimits == wire::kHandLimits);

const char* name_of(Limit limit) {
  return wire::kHandLimitNames[static_cast<std::size_t>(limit)];
}

void Safety::note(Limit limit, SafeForce& safe) {
  safe.limits |= 1u << static_cast<unsigned>(limit);
  ++counts_[static_cast<std::size_t>(limit)];
}

bool Safety::must_stop(const SafetyInput& input, SafeForce& safe) {
  const bool is_finite_input = is_finite(input.force_n) && is_finite(input.torque_nm) &&
                               is_finite(input.position_m) && std::isfinite(input.stiffness_n_m);
  const std::uint32_t before = safe.limits;
  if (!is_finite_input) note(Limit::NotFinite, safe);
  if (!(input.reading_age_s <= settings_.stale_reading_s)) note(Limit::StaleReading, safe);
  if (is_finite_input && has_position_ &&
      length(input.position_m - last_position_m_) > settings_.jump_m)
    note(Limit::Jump, safe);
  return safe.limits != before;
}

SafeForce Safety::step(const SafetyInput& given) {
  SafetyInput input = given;
  input.dt_s = std::max(input.dt_s, kShortestStep_s);
  SafeForce safe;
  if (must_stop(input, safe)) {
    last_force_n_ = last_torque_nm_ = velocity_m_s_ = {};
    has_position_ = is_finite(input.position_m);
    if (has_position_) last_position_m_ = input.position_m;
    ramp_ = work_j_ = 0;
    return safe;
  }
  observe(input);

  // A contact that begins while nobody answers is not felt.
  const bool is_old = input.patch_age_s > settings_.patch_age_s;
  if (!input.touches)
    trust_ = is_old ? 0 : 1;
  else if (is_old)
    trust_ = std::max(0.0, trust_ - input.dt_s / settings_.patch_fall_s);
  else
    trust_ = std::min(1.0, trust_ + input.dt_s / settings_.ramp_s);
  double share = input.touches ? trust_ : 1;
  if (share < 1) note(Limit::OldPatch, safe);
  if (ramp_ < 1) {
    share *= ramp_;
    ramp_ = std::min(1.0, ramp_ + input.dt_s / settings_.ramp_s);
    note(Limit::Ramp, safe);
  }
  const Vec3d passive_n = damped(input.force_n * share, input, safe);

  const double slew_s = std::min(input.dt_s, kLongestSlew_s);
  safe.force_n = towards(last_force_n_, passive_n, settings_.slew_n_s * slew_s);
  const Vec3d torque_nm = input.torque_nm * share;
  safe.torque_nm = towards(last_torque_nm_, torque_nm, settings_.torque_slew_nm_s * slew_s);
  if (!(safe.force_n == passive_n) || !(safe.torque_nm == torque_nm)) note(Limit::Slew, safe);

  const Vec3d force_in_reach = towards({}, safe.force_n, device_.force_n);
  const Vec3d torque_in_reach = towards({}, safe.torque_nm, device_.torque_nm);
  // A device without torque is not told of as limited in each step.
  const bool is_torque_cut = device_.torque_nm > 0 && !(torque_in_reach == safe.torque_nm);
  if (!(force_in_reach == safe.force_n) || is_torque_cut) note(Limit::Device, safe);
  last_force_n_ = safe.force_n = force_in_reach;
  last_torque_nm_ = safe.torque_nm = torque_in_reach;
  return safe;
}

// Adds up the work of the force that was rendered until now. What tissue may have stored bounds the
// sum below, so that energy which viscous tissue has swallowed pays for nothing later.
void Safety::observe(const SafetyInput& input) {
  const Vec3d way_m = has_position_ ? input.position_m - last_position_m_ : Vec3d{};
  last_position_m_ = input.position_m;
  has_position_ = true;
  const double share = input.dt_s / (input.dt_s + kDampedTime_s);
  velocity_m_s_ += (way_m / input.dt_s - velocity_m_s_) * share;
  work_j_ += dot(last_force_n_, way_m);
  const double stiffness_n_m = std::max(kLeastStiffness_n_m, input.stiffness_n_m);
  const double store_j =
      kStoreMargin * length_squared(last_force_n_) / (2 * stiffness_n_m) + kFreeStore_j;
  work_j_ = std::max(work_j_, -store_j);
  if (length(last_force_n_) < kFree_n) work_j_ = std::min(work_j_, 0.0);
}

Vec3d Safety::damped(const Vec3d& force_n, const SafetyInput& input, SafeForce& safe) {
  const double speed_squared = length_squared(velocity_m_s_);
  if (settings_.most_damping_n_s_m <= 0) return force_n;
  if (work_j_ <= 0 || speed_squared < kLeastSpeedSquared) return force_n;
  note(Limit::Passivity, safe);
  const double damping_n_s_m =
      std::min(settings_.most_damping_n_s_m, work_j_ / (speed_squared * input.dt_s));
  return force_n - velocity_m_s_ * damping_n_s_m;
}

}  // namespace trocar::haptics
