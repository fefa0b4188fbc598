#include "client/device/simulated_device.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "client/device/device_checks.h"

namespace trocar::device {
namespace {

constexpr std::uint64_t kStepUs = 1000, kMostStepsAtOnce = 1000;
constexpr int kPartsOfStep = 10;
constexpr double kStepS = 1e-3, kHandForceN = 8, kHandReachM = 0.15;
constexpr double kTouchN = 0.05, kSearchM = 0.1;  // what tells of tissue; farther in it gives up

}  // namespace

SimulatedDevice::SimulatedDevice(HandScript script, ClockUs clock_us, HandModel model)
    : script_(std::move(script)),
      clock_us_(std::move(clock_us)),
      model_(model),
      start_us_(clock_us_()),
      is_searching_(model_.search_m_s > 0 && script_.has_depth()),
      position_m_(script_.position_m(0)) {}

void SimulatedDevice::search() {
  is_searching_ = dot(force_n_, script_.inwards()) > -kTouchN && reach_m_ < kSearchM;
  found_steps_ = steps_;
  if (is_searching_) reach_m_ += model_.search_m_s * kStepS;
}

Vec3d SimulatedDevice::wanted_m(std::uint64_t steps) const {
  return script_.inwards() * reach_m_ +
         script_.position_m(static_cast<double>(steps - found_steps_) * kStepS);
}

void SimulatedDevice::step() {
  if (is_searching_) search();
  const Vec3d wanted = wanted_m(steps_);
  Vec3d& lag = lags_m_[steps_ % lags_m_.size()];  // of a reflex delay ago
  const Vec3d reflex = lag * model_.reflex_n_m;
  lag = wanted - position_m_;
  const bool is_held = start_us_ + steps_ * kStepUs <= written_us_ + kForceHoldUs;
  const Vec3d constant = reflex + (is_held ? force_n_ : Vec3d{});
  constexpr double kPartS = kStepS / kPartsOfStep;
  for (int part = 0; part < kPartsOfStep; ++part) {
    const Vec3d force = constant + (wanted - position_m_) * model_.stiffness_n_m -
                        velocity_m_s_ * model_.damping_n_s_m;
    velocity_m_s_ += force * (kPartS / model_.mass_kg);
    position_m_ += velocity_m_s_ * kPartS;
  }
  ++steps_;
}

void SimulatedDevice::advance() {
  const std::uint64_t now_us = std::max(clock_us_(), start_us_);
  const std::uint64_t due = (now_us - start_us_) / kStepUs;
  if (due > steps_ + kMostStepsAtOnce) {
    steps_ = due;
    if (is_searching_) found_steps_ = steps_;
    position_m_ = wanted_m(steps_);
    velocity_m_s_ = {};
    lags_m_ = {};
  }
  while (steps_ < due) step();
}

Result<DeviceReading> SimulatedDevice::read() {
  advance();
  const auto rounded = [quantum_m = model_.encoder_m](double metres) {
    return std::round(metres / quantum_m) * quantum_m;
  };
  DeviceReading reading;
  reading.position_m = {rounded(position_m_.x), rounded(position_m_.y), rounded(position_m_.z)};
  reading.velocity_m_s = velocity_m_s_;
  reading.gripper = script_.gripper(static_cast<double>(steps_ - found_steps_) * kStepS);
  reading.time_us = start_us_ + steps_ * kStepUs;
  return reading;
}

Status SimulatedDevice::write(const Vec3d& force_n, const Vec3d&) {
  advance();
  force_n_ = checked_force(force_n, kHandForceN);
  written_us_ = start_us_ + steps_ * kStepUs;
  return {};
}

DeviceLimits SimulatedDevice::limits() const {
  return {.force_n = kHandForceN,
          .rate_hz = 1e6 / static_cast<double>(kStepUs),
          .stiffness_n_m = 1000,
          .workspace_m = {kHandReachM, kHandReachM, kHandReachM}};
}

std::string SimulatedDevice::description() const {
  return "simulated hand";
}

}  // namespace trocar::device
