#include "tests/feel/whole_hand.h"

#include <algorithm>
#include <optional>

#include "client/haptics/hand.h"
#include "common/base/assert.h"
#include "tests/haptics/fake_device.h"

namespace trocar::haptics::testing {
namespace {

class StrongDevice final : public FakeDevice {
 public:
  device::DeviceLimits limits() const override {
    return {.force_n = 8, .torque_nm = 0.4, .rate_hz = 1000, .stiffness_n_m = 1000};
  }
};

class WholeHand final : public Client {
 public:
  WholeHand(const tool::ToolShape& shape, const std::vector<wire::HapticLaw>& laws,
            FeltSteps& steps, const SafetySettings& safety)
      : laws_(laws), steps_(steps) {
    settings_.shape = shape;
    settings_.safety = safety;
  }

  void take(const wire::HapticPatch& patch) override {
    TROCAR_ASSERT(hand_);
    hand_->put(patch);
  }

  TouchOutput step(const TouchInput& input) override {
    if (!hand_) start(input);
    auto& reading = device_.reading;
    reading.position_m = input.tip_m - settings_.start_m;
    reading.orientation = input.orientation;
    reading.gripper = input.verb == tool::Verb::Grasp ? 1 : 0;
    reading.buttons = input.verb == tool::Verb::Cut ? settings_.verb_buttons : 0;
    if (input.verb == tool::Verb::None) reading.buttons = device::kRestsButton;
    reading.time_us = input.time_us;
    TROCAR_ASSERT(hand_->step(input.time_us).ok());
    HandState state;
    TROCAR_ASSERT(hand_->take_state(state));
    steps_.model_n = std::max(steps_.model_n, length(state.model_force_n - model_force_n_));
    steps_.hand_n = std::max(steps_.hand_n, length(device_.last_force_n - hand_force_n_));
    steps_.largest_n = std::max(steps_.largest_n, length(device_.last_force_n));
    model_force_n_ = state.model_force_n;
    hand_force_n_ = device_.last_force_n;
    return {.force_n = hand_force_n_};
  }

 private:
  void start(const TouchInput& input) {
    settings_.start_m = input.tip_m;
    hand_.emplace(device_, settings_);
    for (const auto& law : laws_) TROCAR_ASSERT(hand_->put(law));
  }

  HandSettings settings_;
  std::vector<wire::HapticLaw> laws_;
  FeltSteps& steps_;
  StrongDevice device_;
  std::optional<Hand> hand_;
  Vec3d model_force_n_, hand_force_n_;
};

}  // namespace

std::unique_ptr<Client> make_hand(const tool::ToolShape& shape,
                                  const std::vector<wire::HapticLaw>& laws, FeltSteps& steps,
                                  const SafetySettings& safety) {
  return std::make_unique<WholeHand>(shape, laws, steps, safety);
}

}  // namespace trocar::haptics::testing
