#include "client/haptics/touch_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trocar::haptics {
namespace {

constexpr double kUsualStep_s = 0.001;
constexpr double kLongestStep_s = 0.1;
constexpr double kVelocityTime_s = 1 / (2 * std::numbers::pi * 40);
constexpr double kFarAbove_m = -1;  // a depth, where there is no surface
constexpr double kMostSlant = 0.2;  // of an edge's cosine to the normal

Vec3d across(const Vec3d& v, const Vec3d& normal) {
  return v - normal * dot(v, normal);
}

Vec3d shortened(const Vec3d& v, double limit) {
  const double size = length(v);
  return size > limit ? v * (limit / size) : v;
}

}  // namespace

TouchModel::TouchModel(const tool::ToolShape& shape, const TouchSettings& settings)
    : shape_(shape), settings_(settings), fit_(settings.forget_s, settings.follow_s) {
  use_material();
}

Vec3d TouchModel::model_force(const Response& response) const {
  return surface_.normal * response.normal_n + response.rest_n;
}

Vec3d TouchModel::scaled_force(const Response& response, double slope, const Vec3d& lean) const {
  return model_force(response) * slope + across(lean, surface_.normal) * response.normal_n +
         response.sides_n;
}

PastState TouchModel::state_of(const TouchInput& input) const {
  const Vec3d along = to_double(rotate(input.orientation, {0, 0, 1}));
  const Vec3d sideways = to_double(rotate(input.orientation, {1, 0, 0}));
  PastState state;
  state.axis = along;
  state.time_us = input.time_us;
  state.tip_m = input.tip_m;
  state.core_m = input.tip_m + along * static_cast<double>(shape_.radius_m);
  state.clearance_m =
      shape_.radius_m + shape_.half_width_m * std::abs(dot(sideways, surface_.normal));
  return state;
}

void TouchModel::answer(PastState& state, double dt_s) {
  if (steps_.dt_s() != dt_s) steps_ = ViscoSteps(materials_.now().law, dt_s);
  if (grips()) {
    state.grip_point_m = surface_.believed_grip_m();
    state.response = grip_.step(steps_, state.tip_m, state.grip_point_m);
    return;
  }
  state.depth_m =
      has_surface() ? surface_.believed_depth_of(state.core_m, state.clearance_m) : kFarAbove_m;
  if (cuts()) {
    // The edge goes up along the shaft.
    const double slant = std::max(kMostSlant, dot(state.axis, surface_.normal));
    const double length_m = std::min(state.depth_m / slant, static_cast<double>(shape_.edge_m));
    state.response =
        blade_.step(state.tip_m, state.axis, length_m, side_friction_n_m_ * length_m, dt_s);
  } else {
    state.response = push_.step(power_law_, steps_, state.depth_m, state.core_m, surface_.normal,
                                static_cast<double>(patch_.friction));
  }
}

TouchOutput TouchModel::step(const TouchInput& input) {
  double dt_s = kUsualStep_s;
  PastState state = state_of(input);
  if (!past_.is_empty()) {
    const PastState& last = past_[past_.end() - 1];
    if (input.time_us <= last.time_us) return output_;
    dt_s = std::min(static_cast<double>(input.time_us - last.time_us) * 1e-6, kLongestStep_s);
    const Vec3d velocity_m_s = (state.core_m - last.core_m) / dt_s;
    velocity_m_s_ += (velocity_m_s - velocity_m_s_) * (dt_s / (dt_s + kVelocityTime_s));
  }
  blend(dt_s);
  jaws_.step(input.verb, input.time_us, grips(), dt_s);
  answer(state, dt_s);
  past_.add(state);

  const Response& response = state.response;
  Vec3d force_n = limited_force(corrected_force(response), response);
  if (stop_.is_on()) force_n = stopped_force(force_n, state.core_m, dt_s);
  if (grips()) force_n *= jaws_.held_share();
  output_.force_n = force_n;
  output_.torque_nm = correction_.lever_m * length(force_n);
  output_.touches = grips() || length(force_n) > 0 || stop_.is_on();
  output_.stiffness_n_m =
      stop_.is_on() ? stop_.stiffness_n_m() : correction_.slope * response.stiffness_n_m;
  return output_;
}

void TouchModel::blend(double dt_s) {
  const double share = std::min(1.0, dt_s / settings_.blend_s);
  correction_.blend(fit_, share);
  correction_.limit(static_cast<double>(patch_.pressed_limit_n), length(output_.force_n), share);
  surface_.depth_offset_m *= 1 - share;
  surface_.grip_offset_m *= 1 - share;
}

Vec3d TouchModel::corrected_force(const Response& response) const {
  double gate = 1;
  if (!grips())
    gate = std::clamp(response.elastic_n / (settings_.gate * correction_.gate_force_n), 0.0, 1.0);
  return scaled_force(response, correction_.slope, correction_.lean) + correction_.n * gate;
}

Vec3d TouchModel::limited_force(const Vec3d& force_n, const Response& response) const {
  if (grips()) {
    const double limit_n = patch_.grip_limit_n;
    return limit_n > 0 ? shortened(force_n, limit_n) : force_n;
  }
  if (response.elastic_n <= 0) return {};
  if (cuts()) return force_n;
  double along_n = std::max(0.0, dot(force_n, surface_.normal));
  along_n = std::min(along_n, correction_.pressed_limit_n);
  const double leans_n = length(correction_.lean) * std::max(0.0, response.normal_n);
  return surface_.normal * along_n +
         shortened(across(force_n, surface_.normal), patch_.friction * along_n + leans_n);
}

Vec3d TouchModel::stopped_force(const Vec3d& force_n, const Vec3d& core_m, double dt_s) {
  const double along_n = stop_.step(core_m, velocity_m_s_, dt_s);
  return stop_.normal() * along_n +
         shortened(across(force_n, stop_.normal()), patch_.friction * along_n);
}

}  // namespace trocar::haptics
