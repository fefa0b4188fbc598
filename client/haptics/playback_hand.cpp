#include "client/haptics/playback_hand.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace trocar::haptics {
namespace {

constexpr double kRise_s = 0.250, kFall_s = 0.050;
constexpr double kPullVelocityTime_s = 1 / (2 * std::numbers::pi * 40);
constexpr double kTicks_us = static_cast<double>(kTickNanoseconds) * 1e-3;
constexpr double kJumpTicks = 50;
constexpr std::uint64_t kOldMoment_us = 250'000;

SafetySettings led(SafetySettings safety) {
  safety.most_damping_n_s_m = 0;
  return safety;
}

}  // namespace

PlaybackHand::PlaybackHand(device::HapticDevice& device, replay::RecordedHand hand,
                           const PlaybackSettings& settings, Trace* trace)
    : device_(device),
      hand_(std::move(hand)),
      settings_(settings),
      safety_(device.limits(), led(settings.safety)),
      trace_(trace) {}

bool PlaybackHand::find_tick(std::uint64_t now_us, double& tick) {
  const auto now_of = [&](const PlaybackMoment& moment) {
    const double since_us =
        now_us > moment.time_us ? static_cast<double>(now_us - moment.time_us) : 0;
    return moment.tick + (moment.is_running ? since_us / kTicks_us : 0);
  };
  const double expected = now_of(moment_);
  if (moments_.take(moment_) && std::abs(now_of(moment_) - expected) > kJumpTicks)
    has_jumped_ = true;
  tick = now_of(moment_);
  return moment_.is_running && now_us <= moment_.time_us + kOldMoment_us;
}

Vec3d PlaybackHand::pull_of(const Vec3d& tip_m, const Vec3d& recorded_m) const {
  Vec3d pull_n = workspace_.device_way(recorded_m - tip_m) * settings_.pull_n_m;
  const double size = length(pull_n);
  if (size > settings_.most_pull_n) pull_n *= settings_.most_pull_n / size;
  return pull_n - velocity_m_s_ * (settings_.pull_n_m > 0 ? settings_.damping_n_s_m : 0);
}

Status PlaybackHand::step(std::uint64_t now_us) {
  auto reading = device_.read();
  if (!reading) return reading.error();
  const double dt_s =
      last_us_ == 0 || now_us <= last_us_ ? 0.001 : static_cast<double>(now_us - last_us_) * 1e-6;
  const bool is_sound = is_finite(reading->position_m);
  if (is_sound) {
    const Vec3d way_m = last_us_ == 0 ? Vec3d{} : reading->position_m - last_m_;
    velocity_m_s_ += (way_m / dt_s - velocity_m_s_) * (dt_s / (dt_s + kPullVelocityTime_s));
    last_m_ = reading->position_m;
  }
  last_us_ = now_us;

  double tick = 0;
  const bool is_running = find_tick(now_us, tick);
  const auto felt = hand_.felt_at(tick);
  const bool is_clutched =
      (reading->buttons & (settings_.clutch_buttons | device::kLetGoButton)) != 0;
  const bool is_on = is_running && felt.is_felt && !is_clutched && is_sound;
  // A jump is faded out of, like a pause, and into again.
  const bool rises = is_on && !has_jumped_;
  share_ = rises ? std::min(1.0, share_ + dt_s / kRise_s) : std::max(0.0, share_ - dt_s / kFall_s);
  if (is_on && has_jumped_ && share_ == 0) {
    workspace_ = Workspace(felt.tip_m, settings_.scale);
    has_jumped_ = false;
  }
  if (!is_on) has_jumped_ = true;
  if (rises) {
    const auto tip = workspace_.move(last_m_, {}, false);
    force_n_ = workspace_.device_force(felt.force_n) + pull_of(tip.position_m, felt.tip_m);
    torque_nm_ = workspace_.device_torque(felt.torque_nm);
    state_.reading.tip_m = tip.position_m;
  }

  if (lets_go_) share_ = 0;
  SafetyInput input;
  input.force_n = force_n_ * share_;
  input.torque_nm = torque_nm_ * share_;
  input.position_m = reading->position_m;
  input.reading_age_s =
      now_us > reading->time_us ? static_cast<double>(now_us - reading->time_us) * 1e-6 : 0;
  input.dt_s = dt_s;
  const SafeForce safe = safety_.step(input);
  Status written = device_.write(safe.force_n, safe.torque_nm);

  state_.reading.time_us = now_us;
  state_.model_force_n = state_.server_force_n = felt.force_n;
  state_.hand_force_n = safe.force_n;
  state_.hand_torque_nm = safe.torque_nm;
  state_.largest_force_n = std::max(state_.largest_force_n, length(safe.force_n));
  state_.largest_server_force_n =
      std::max(state_.largest_server_force_n, length(state_.server_force_n));
  state_.reading_age_s = input.reading_age_s;
  state_.limits = safe.limits;
  state_.limit_counts = safety_.counts();
  state_.largest_force_n = std::max(state_.largest_force_n, length(safe.force_n));
  state_.largest_server_force_n = std::max(state_.largest_server_force_n, length(felt.force_n));
  ++state_.steps;
  states_.put(state_);
  if (trace_)
    trace_->add({now_us, to_float(state_.reading.tip_m), to_float(safe.force_n),
                 to_float(felt.force_n), 0, safe.limits});
  return written;
}

bool PlaybackHand::let_go() {
  lets_go_ = true;
  return state_.hand_force_n == Vec3d{} && state_.hand_torque_nm == Vec3d{};
}

void PlaybackHand::stop() {
  lets_go_ = false;
  static_cast<void>(device_.write({}, {}));
}

}  // namespace trocar::haptics
