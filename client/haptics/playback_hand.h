#pragma once

// An expert's recorded force on a learner's hand, once a millisecond, while the recording plays:
//
//   F = share (force scale x recorded force + pull (recorded place - own place) - damping v)
//
// Nobody can be shown a force and a motion at once: a hand that is moved exactly feels no force of
// its own, and one that is only pushed leaves the way (Yokokohji et al. 1996). So the force is the
// expert's, and a weak spring leads along the expert's way: a learner who resists the force as the
// expert did stays on it. The spring pulls with 1 N at most, less than tissue does.
//
// share grows from 0 within 250 ms, and falls within 50 ms where nothing is recorded, the recording
// stands or plays at another speed than 1 (its forces belong to that speed), the clutch is held, or
// nobody has said for 250 ms where it is. After each of these, and where the recording jumps, the
// expert's place is where the learner's hand is. All of it passes through the safety chain; its
// passivity is off, as to lead a hand is work.
//
// Threads: as with Hand.

#include "client/haptics/hand.h"
#include "client/replay/recorded_hand.h"

namespace trocar::haptics {

struct PlaybackSettings {
  WorkspaceScale scale;
  double pull_n_m = 80;  // at the device; 0: the force alone
  double most_pull_n = 1;
  double damping_n_s_m = 1;  // of the pull
  SafetySettings safety;
  std::uint32_t clutch_buttons = 1;
};

// Says where the recording was at a time of the loop's clock.
struct PlaybackMoment {
  double tick = 0;
  std::uint64_t time_us = 0;
  bool is_running = false;  // at speed 1
};

class PlaybackHand final : public Stepped {
 public:
  PlaybackHand(device::HapticDevice& device, replay::RecordedHand hand,
               const PlaybackSettings& settings, Trace* trace = nullptr);

  void put(const PlaybackMoment& moment) { moments_.put(moment); }
  bool take_state(HandState& state) { return states_.take(state); }

  Status step(std::uint64_t now_us) override;
  bool let_go() override;
  void stop() override;

 private:
  // Finds where the recording is now. False: it is not to be felt.
  bool find_tick(std::uint64_t now_us, double& tick);
  Vec3d pull_of(const Vec3d& tip_m, const Vec3d& recorded_m) const;

  device::HapticDevice& device_;
  const replay::RecordedHand hand_;
  const PlaybackSettings settings_;
  Safety safety_;
  Trace* const trace_;

  Newest<PlaybackMoment> moments_;
  Newest<HandState> states_;

  PlaybackMoment moment_;
  Workspace workspace_{{}};
  double share_ = 0;
  Vec3d force_n_, torque_nm_;  // in the device's frame, before the share; the last that were felt
  Vec3d last_m_, velocity_m_s_;
  std::uint64_t last_us_ = 0;  // 0: there was none
  bool has_jumped_ = true;
  bool lets_go_ = false;  // until it is stopped
  HandState state_;
};

}  // namespace trocar::haptics
