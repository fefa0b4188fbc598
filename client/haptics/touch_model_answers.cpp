// The part of the model that takes the server's answers.

#include <algorithm>
#include <utility>

#include "client/haptics/touch_model.h"

namespace trocar::haptics {
namespace {

constexpr double kSlow_s = 0.050;           // the time that a patch's stiffness is of
constexpr double kLeastGateForce_n = 0.02;  // under it the correction is gone in any case
constexpr double kClearlyAbove_m = -0.001;  // a depth
constexpr double kGuessDepth_m = 0.005;
constexpr double kLongestPause_s = 0.1;  // between two answers, for the fit
constexpr double kAnswerShare = 0.1;     // of a new delay in the smoothed one
constexpr std::size_t kMostReplayed = 1024;
constexpr std::size_t kBladeReplayed = 300;
constexpr double kLeastBladeForce_n = 0.05, kMostBladeSlope = 30, kBladeFollow_s = 0.05;
// A server that counts from the beginning again is not late: its answers are of much later poses.
constexpr std::uint64_t kNewSession_us = 1'000'000;

SymMat3<double> to_double(const SymMat3f& a) {
  return {a.xx, a.xy, a.xz, a.yy, a.yz, a.zz};
}

SymMat3<double> scaled(const SymMat3<double>& a, double s) {
  return {a.xx * s, a.xy * s, a.xz * s, a.yy * s, a.yz * s, a.zz * s};
}

// The stiffness along a direction, which need not be of unit length.
double along(const SymMat3<double>& stiffness, const Vec3d& direction) {
  return dot(direction, stiffness * direction) / length_squared(direction);
}

}  // namespace

void TouchModel::take(const wire::HapticLaw& law) {
  if (!materials_.take(law)) return;
  use_material();
  restart(past_.end());
}

bool TouchModel::is_old(const wire::HapticPatch& patch) const {
  if (!has_patch_ || static_cast<std::int32_t>(patch.sequence - patch_.sequence) > 0) return false;
  return patch.echo_time_us < patch_.echo_time_us + kNewSession_us;
}

void TouchModel::take(const wire::HapticPatch& patch) {
  if (is_old(patch)) {
    ++counts_.old_patches;
    return;
  }
  ++counts_.patches;
  const bool had_surface = has_surface(), gripped = grips();
  const Element element_before = element();
  const bool is_new_structure = has_patch_ && patch.structure != patch_.structure;
  patch_ = patch;
  has_patch_ = true;
  take_surface(had_surface, gripped);
  const bool is_new_law = materials_.use(patch_.law);
  if (is_new_law) use_material();
  take_stop();
  jaws_.take(grips(), patch.echo_time_us);

  const auto found = past_.find(patch.echo_time_us);
  if (!found) {
    ++counts_.unmatched_patches;
    if (is_new_law || element_before != element()) restart(past_.end());
    return;
  }
  const std::uint64_t newest_us = past_[past_.end() - 1].time_us;
  const double answer_s =
      static_cast<double>(newest_us - std::min(patch.echo_time_us, newest_us)) * 1e-6;
  answer_s_ += (answer_s - answer_s_) * (answer_s_ == 0 ? 1 : kAnswerShare);
  if (is_new_law || element_before != element()) {
    restart(*found);
  } else if (cuts()) {
    correct_blade(*past_.at(patch.echo_time_us));
  } else {
    correct(*past_.at(patch.echo_time_us), is_new_structure);
  }
  last_echo_us_ = patch.echo_time_us;
}

void TouchModel::take_surface(bool had_surface, bool gripped) {
  if (!has_surface()) return;
  const PastState last = past_.is_empty() ? PastState{} : past_[past_.end() - 1];
  const double believed_m = surface_.believed_depth_of(last.core_m, last.clearance_m);
  surface_.normal = normalized(trocar::to_double(patch_.plane_normal), surface_.normal);
  surface_.plane_m = trocar::to_double(patch_.plane_point_m);
  const double newest_m = surface_.depth_of(last.core_m, last.clearance_m);
  const bool is_far = !output_.touches && newest_m < kClearlyAbove_m;
  surface_.depth_offset_m = had_surface && !is_far ? believed_m - newest_m : 0;

  if (!grips()) return;
  const Vec3d believed_grip_m = surface_.believed_grip_m();
  surface_.grip_point_m = trocar::to_double(patch_.grip_point_m);
  surface_.grip_offset_m = gripped ? believed_grip_m - surface_.grip_point_m : Vec3d{};
  if (gripped && patch_.has_stiffness) grip_.set_stiffness(grip_stiffness());
}

void TouchModel::use_material() {
  const auto& material = materials_.now();
  power_law_ = first_guess(material.law, static_cast<double>(shape_.radius_m));
  slow_share_ = relaxed_share(material.law, kSlow_s);
  steps_ = {};
}

void TouchModel::take_stop() {
  const bool is_refused = patch_.kind == wire::TouchKind::Rigid;
  if (past_.is_empty() || is_refused == stop_.is_on()) return;
  const PastState& last = past_[past_.end() - 1];
  if (is_refused) {
    stop_.begin(last.core_m, surface_.normal,
                surface_.believed_depth_of(last.core_m, last.clearance_m),
                std::max(0.0, dot(output_.force_n, surface_.normal)), settings_.stop_n_m);
  } else {
    stop_.end();
    keep_force(last.response);
  }
}

// Chooses the correction so that the force goes on as it is.
void TouchModel::keep_force(const Response& response) {
  correction_.n = output_.force_n - scaled_force(response, correction_.slope, correction_.lean);
}

SymMat3<double> TouchModel::grip_stiffness() const {
  if (patch_.has_stiffness) return scaled(to_double(patch_.stiffness_n_m), 1 / slow_share_);
  const double k = power_law_.stiffness_n_m(kGuessDepth_m);
  SymMat3<double> stiffness;
  stiffness.add_identity(kAcrossOverNormal * k);
  stiffness.add_outer(surface_.normal, (1 - kAcrossOverNormal) * k);
  return stiffness;
}

// The local model begins anew with what it is now, at the pose that the answer belongs to.
void TouchModel::restart(std::size_t first) {
  if (grips()) grip_.start(grip_stiffness());
  fit_.set_slope(grips() || cuts() ? 1 : materials_.now().slope);
  fit_.clear_sums();
  correction_.slope = fit_.slope();
  correction_.lean = fit_.lean();
  push_.start(kClearlyAbove_m);
  if (past_.is_empty()) return;
  const std::size_t answered = first;
  // The direction of a blade is that of its way before.
  if (cuts()) first = first > kBladeReplayed ? first - kBladeReplayed : 0;
  first = std::max({first, past_.begin(),
                    past_.end() > kMostReplayed ? past_.end() - kMostReplayed : std::size_t{0}});
  first = std::min(first, past_.end() - 1);
  blade_.start(past_[first].tip_m);
  if (has_surface()) push_.start(surface_.depth_of(past_[first].core_m, past_[first].clearance_m));
  for (std::size_t i = first; i < past_.end(); ++i) {
    const bool has_previous = i > past_.begin();
    const std::uint64_t dt_us = has_previous ? past_[i].time_us - past_[i - 1].time_us : 1000;
    answer(past_[i], static_cast<double>(dt_us) * 1e-6);
  }
  const PastState& then_state = past_[std::clamp(answered, first, past_.end() - 1)];
  if (cuts()) {
    fit_.set_slope(blade_slope(then_state.response));
    correction_.slope = fit_.slope();
    take_side_friction(then_state.response);
  }
  const Response& then = then_state.response;
  correction_.next_n = {};
  if (touches(patch_.kind))
    correction_.next_n =
        trocar::to_double(patch_.force_n) - scaled_force(then, correction_.slope, correction_.lean);
  correction_.gate_force_n = std::max(kLeastGateForce_n, then.elastic_n);
  keep_force(past_[past_.end() - 1].response);
}

// The stiffness of held tissue acts on the pull, that of pushed tissue on the depth: by them what
// was answered follows a reference that has moved since.
Response TouchModel::with_moved_reference(const PastState& then) const {
  Response response = then.response;
  const double share = settings_.moved_share * slow_share_;
  if (grips()) {
    const Vec3d moved_m = surface_.grip_point_m - then.grip_point_m;
    response.rest_n += grip_.stiffness() * moved_m * share;
  } else if (response.elastic_n > 0) {
    const double deeper_m = surface_.depth_of(then.core_m, then.clearance_m) - then.depth_m;
    response.normal_n += response.stiffness_n_m * deeper_m * share;
    response.elastic_n = std::max(0.0, response.elastic_n + response.stiffness_n_m * deeper_m);
    response.rest_n = response.rest_n - surface_.normal * dot(response.rest_n, surface_.normal);
  }
  return response;
}

// By how much more the server's blade would be held back if both went on; that of before where the
// local one is not in tissue. What the server's force is now would say less: it falls where a hand
// stops or turns, and friction is in it.
double TouchModel::blade_slope(const Response& response) const {
  if (response.elastic_n < kLeastBladeForce_n) return fit_.slope();
  return std::clamp(static_cast<double>(patch_.cut_force_n) / response.elastic_n, 0.0,
                    kMostBladeSlope);
}

void TouchModel::take_side_friction(const Response& then) {
  if (then.elastic_n < kLeastBladeForce_n) return;
  const double length_m = then.elastic_n / BladeElement::kEnergy_j_m2;
  side_friction_n_m_ = static_cast<double>(patch_.side_friction_n) / length_m;
}

void TouchModel::correct_blade(const PastState& then) {
  take_side_friction(then.response);
  const double dt_s =
      patch_.echo_time_us > last_echo_us_
          ? std::min(static_cast<double>(patch_.echo_time_us - last_echo_us_) * 1e-6,
                     kLongestPause_s)
          : 0;
  const double slope = fit_.slope();
  fit_.set_slope(slope +
                 (blade_slope(then.response) - slope) * std::min(1.0, dt_s / kBladeFollow_s));
  correction_.next_n =
      trocar::to_double(patch_.force_n) - scaled_force(then.response, fit_.slope(), {});
  correction_.gate_force_n = std::max(kLeastGateForce_n, then.response.elastic_n);
  take_lever();
}

void TouchModel::take_lever() {
  if (const float force_n = length(patch_.force_n); force_n > kLeastGateForce_n)
    correction_.next_lever_m = trocar::to_double(patch_.torque_nm) / static_cast<double>(force_n);
}

void TouchModel::correct(const PastState& then, bool is_new_structure) {
  if (patch_.kind == wire::TouchKind::Rigid) return;
  // Tissue that the server's tool does not touch has given way where the local model presses.
  const bool touched = touches(patch_.kind);
  const Response response = with_moved_reference(then);
  if (!touched && response.elastic_n <= 0) {
    correction_.next_n = {};
    expect();
    return;
  }
  const Vec3d server_n = touched ? trocar::to_double(patch_.force_n) : Vec3d{};
  const Vec3d local_n = model_force(response);
  // A tool that is stopped says nothing of the tissue below it.
  const double believed_n = dot(local_n * fit_.slope() + correction_.next_n, surface_.normal);
  if (!is_new_structure && patch_.pressed_limit_n > 0 &&
      believed_n > static_cast<double>(patch_.pressed_limit_n))
    return;
  // The slope of a push is that along the normal; friction follows.
  const Vec3d fit_server_n = grips() ? server_n : Vec3d{dot(server_n, surface_.normal), 0, 0};
  const Vec3d fit_local_n = grips() ? local_n : Vec3d{response.normal_n, 0, 0};
  if (is_new_structure) {
    fit_.restart(fit_server_n, fit_local_n);
  } else if (touched && patch_.echo_time_us > last_echo_us_) {
    const double dt_s =
        std::min(static_cast<double>(patch_.echo_time_us - last_echo_us_) * 1e-6, kLongestPause_s);
    fit_.add(fit_server_n, fit_local_n, dt_s, stiffness_ratio(response));
    if (!grips()) {
      const Vec3d rest_n = server_n - response.rest_n * fit_.slope();
      fit_.add_lean(rest_n - surface_.normal * dot(rest_n, surface_.normal), response.normal_n);
    }
  }
  if (!grips()) {
    materials_.now().slope = fit_.slope();
    if (touched) materials_.now().is_felt = true;
  }
  correction_.next_n = server_n - scaled_force(response, fit_.slope(), fit_.lean());
  correction_.gate_force_n = std::max(kLeastGateForce_n, response.elastic_n);
  take_lever();
}

// The server says of tissue that is near how stiff it expects it to be, as far as its shape tells.
// A slope that was felt elsewhere is scaled by how much stiffer this place should be than that one.
void TouchModel::expect() {
  if (patch_.kind != wire::TouchKind::Near || !patch_.has_stiffness) return;
  auto& material = materials_.now();
  const double local_n_m = power_law_.stiffness_n_m(kGuessDepth_m) * slow_share_;
  const double expected =
      std::clamp(along(to_double(patch_.stiffness_n_m), surface_.normal) / local_n_m,
                 SlopeFit::kLeast, SlopeFit::kMost);
  if (!material.is_felt) material.slope *= expected / material.expected_slope;
  material.expected_slope = expected;
  material.is_felt = false;
  fit_.set_slope(std::clamp(material.slope, SlopeFit::kLeast, SlopeFit::kMost));
}

std::optional<double> TouchModel::stiffness_ratio(const Response& response) const {
  if (!patch_.has_stiffness) return std::nullopt;
  const Vec3d direction = grips() ? model_force(response) : surface_.normal;
  if (length(direction) < SlopeFit::kLeastForce_n) return std::nullopt;
  const double server_n_m = along(to_double(patch_.stiffness_n_m), direction);
  const double local_n_m = grips() ? along(grip_.stiffness(), direction) : response.stiffness_n_m;
  if (!(local_n_m > 0)) return std::nullopt;
  return server_n_m / (local_n_m * slow_share_);
}

}  // namespace trocar::haptics
