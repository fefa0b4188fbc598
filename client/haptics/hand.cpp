#include "client/haptics/hand.h"

#include <algorithm>
#include <cmath>

namespace trocar::haptics {
namespace {

constexpr double kFirstStep_s = 0.001;
constexpr double kWorkingDepth_m = 0.050;  // a tool works so much deeper than it starts, or less

std::optional<Fulcrum> fulcrum_of(const HandSettings& settings) {
  if (!settings.port_m) return std::nullopt;
  return Fulcrum(*settings.port_m, settings.start_m, settings.shape.length_m);
}

TouchSettings settings_for(const HandSettings& settings, const device::DeviceLimits& limits) {
  TouchSettings touch = settings.touch;
  if (limits.stiffness_n_m > 0) {
    const Workspace workspace(settings.start_m, settings.scale);
    double rendered_n_m = workspace.world_stiffness(limits.stiffness_n_m);
    if (auto fulcrum = fulcrum_of(settings)) {
      const Vec3d in = *settings.port_m - fulcrum->handle_m();
      fulcrum->move(fulcrum->handle_m() + in * (kWorkingDepth_m / length(in)), {});
      rendered_n_m /= fulcrum->stiffening();
    }
    touch.stop_n_m = std::min(touch.stop_n_m, rendered_n_m);
  }
  return touch;
}

double seconds_between(std::uint64_t from_us, std::uint64_t to_us) {
  return to_us > from_us ? static_cast<double>(to_us - from_us) * 1e-6 : 0;
}

// A reading that is no place would stay in the model for ever.
bool is_sound(const device::DeviceReading& reading) {
  const float size = norm(reading.orientation);
  return is_finite(reading.position_m) && std::isfinite(size) && size > 0.5f;
}

}  // namespace

Hand::Hand(device::HapticDevice& device, const HandSettings& settings, Trace* trace)
    : device_(device),
      settings_(settings),
      fulcrum_(fulcrum_of(settings)),
      workspace_(fulcrum_ ? fulcrum_->handle_m() : settings.start_m, settings.scale),
      model_(settings.shape, settings_for(settings, device.limits())),
      safety_(device.limits(), settings.safety),
      trace_(trace),
      laws_(kWaitingLaws) {}

void Hand::take_messages(std::uint64_t now_us) {
  while (const auto law = laws_.try_pop()) model_.take(*law);
  if (wire::HapticPatch patch; patches_.take(patch)) {
    model_.take(patch);
    patch_us_ = now_us;
  }
  if (Quatf view; !touch_.touches && views_.take(view)) workspace_.set_view(view);
}

tool::Verb Hand::verb_of(const device::DeviceReading& reading) {
  is_closed_ = reading.gripper > (is_closed_ ? settings_.opens_at : settings_.closes_at);
  if ((reading.buttons & device::kRestsButton) != 0) return tool::Verb::None;
  const bool is_pressed = (reading.buttons & settings_.verb_buttons) != 0;
  if (is_pressed && settings_.button_verb != tool::Verb::Push) return settings_.button_verb;
  return is_closed_ ? settings_.gripper_verb : tool::Verb::Push;
}

void Hand::feel(const device::DeviceReading& reading, std::uint64_t now_us) {
  const bool is_clutched =
      (reading.buttons & (settings_.clutch_buttons | device::kLetGoButton)) != 0;
  auto tip = workspace_.move(reading.position_m, reading.orientation, is_clutched);
  if (fulcrum_) {
    const auto inside = fulcrum_->move(tip.position_m, tip.orientation);
    tip = {inside.position_m, inside.orientation};
  }
  HandReading& sent = state_.reading;
  const double dt_s = seconds_between(last_us_, now_us);
  sent.velocity_m_s = last_us_ != 0 && dt_s > 0 ? (tip.position_m - sent.tip_m) / dt_s : Vec3d{};
  sent.tip_m = tip.position_m;
  sent.orientation = tip.orientation;
  sent.verb = verb_of(reading);
  sent.time_us = now_us;
  readings_.put(sent);
  touch_ = model_.step({sent.tip_m, sent.orientation, sent.verb, now_us});
  if (sent.verb == tool::Verb::None || lets_go_) touch_ = {};
}

Status Hand::step(std::uint64_t now_us) {
  auto reading = device_.read();
  if (!reading) return reading.error();
  take_messages(now_us);
  if (is_sound(*reading)) feel(*reading, now_us);

  Fulcrum::Load load{touch_.force_n, touch_.torque_nm};
  if (fulcrum_) load = fulcrum_->at_handle(touch_.force_n, touch_.torque_nm);
  SafetyInput input;
  input.force_n = workspace_.device_force(load.force_n);
  input.torque_nm = workspace_.device_torque(load.torque_nm);
  input.position_m = is_sound(*reading) ? reading->position_m : Vec3d{NAN, NAN, NAN};
  input.stiffness_n_m =
      workspace_.device_stiffness(touch_.stiffness_n_m) * (fulcrum_ ? fulcrum_->stiffening() : 1);
  input.reading_age_s = seconds_between(reading->time_us, now_us);
  input.patch_age_s = patch_us_ == 0 ? 0 : seconds_between(patch_us_, now_us);
  input.touches = touch_.touches;
  input.dt_s = last_us_ == 0 ? kFirstStep_s : seconds_between(last_us_, now_us);
  const SafeForce safe = safety_.step(input);
  last_us_ = now_us;
  Status written = device_.write(safe.force_n, safe.torque_nm);

  state_.model_force_n = touch_.force_n;
  state_.hand_force_n = safe.force_n;
  state_.hand_torque_nm = safe.torque_nm;
  state_.hand_force_in_world_n = workspace_.in_world(safe.force_n);
  state_.time_us = now_us;
  state_.server_force_n = to_double(model_.newest_patch().force_n);
  state_.largest_force_n = std::max(state_.largest_force_n, length(safe.force_n));
  state_.largest_server_force_n =
      std::max(state_.largest_server_force_n, length(state_.server_force_n));
  state_.patch_age_s = input.patch_age_s;
  state_.answer_s = model_.answer_s();
  state_.slope = model_.slope();
  state_.reading_age_s = input.reading_age_s;
  state_.limits = safe.limits;
  state_.limit_counts = safety_.counts();
  state_.patches = model_.counts();
  ++state_.steps;
  states_.put(state_);
  reports_.put(state_);
  if (trace_)
    trace_->add({now_us, to_float(state_.reading.tip_m), to_float(safe.force_n),
                 to_float(state_.server_force_n), static_cast<float>(state_.patch_age_s),
                 safe.limits});
  return written;
}

bool Hand::let_go() {
  lets_go_ = true;
  return state_.hand_force_n == Vec3d{} && state_.hand_torque_nm == Vec3d{};
}

void Hand::stop() {
  lets_go_ = false;
  static_cast<void>(device_.write({}, {}));
}

}  // namespace trocar::haptics
