#pragma once

// One hand on a device: what happens between reading it and writing a force to it, once a
// millisecond.
//
//   device -> workspace (-> fulcrum) -> touch model (-> fulcrum) -> workspace -> safety -> device
//
// Threads: step() and stop() belong to the loop's; put() of each kind to one other thread each, and
// so do take_reading(), take_state() and take_report(). None waits for another, and step() does not
// allocate.

#include <cstdint>
#include <optional>

#include "client/device/haptic_device.h"
#include "client/haptics/fulcrum.h"
#include "client/haptics/safety.h"
#include "client/haptics/stepped.h"
#include "client/haptics/touch_model.h"
#include "client/haptics/trace.h"
#include "client/haptics/workspace.h"
#include "common/base/newest.h"
#include "common/base/result.h"
#include "common/base/spsc_queue.h"

namespace trocar::haptics {

struct HandSettings {
  tool::ToolShape shape;
  Vec3d start_m;                // of the tool's tip, world frame
  std::optional<Vec3d> port_m;  // that the shaft passes, in reach of it (fulcrum.h); none: free
  WorkspaceScale scale;
  TouchSettings touch;
  SafetySettings safety;
  std::uint32_t clutch_buttons = 1, verb_buttons = 2;  // bits: any of them
  float closes_at = 0.6f, opens_at = 0.4f;             // of the gripper
  // A closed gripper and a pressed button ask for this; Push: for nothing more.
  tool::Verb gripper_verb = tool::Verb::Grasp, button_verb = tool::Verb::Cut;
};

// This goes to the server.
struct HandReading {
  Vec3d tip_m, velocity_m_s;  // world frame; velocity over the last step
  Quatf orientation;
  tool::Verb verb = tool::Verb::Push;
  std::uint64_t time_us = 0;
};

// Pictures and statistics are made of this.
struct HandState {
  std::uint64_t time_us = 0;  // of this step
  HandReading reading;
  Vec3d model_force_n;                 // world frame, on the tool
  Vec3d hand_force_n, hand_torque_nm;  // in the device's frame, as it was written
  Vec3d hand_force_in_world_n;         // the same, turned into the world frame
  Vec3d server_force_n;                // of the newest patch, world frame
  double largest_force_n = 0, largest_server_force_n = 0;  // since the start
  double patch_age_s = 0;                                  // since it came; 0 before the first
  double answer_s = 0;  // from a pose to the answer that belongs to it
  double slope = 1;     // of the server's tissue over the local one
  double reading_age_s = 0;
  std::uint32_t limits = 0;  // as in SafeForce, of this step
  Safety::Counts limit_counts{};
  TouchCounts patches;
  std::uint64_t steps = 0;
};

class Hand final : public Stepped {
 public:
  // trace: gets a row in each step; null: none. It outlives the hand.
  Hand(device::HapticDevice& device, const HandSettings& settings, Trace* trace = nullptr);

  void put(const wire::HapticPatch& patch) { patches_.put(patch); }
  // False: too many came at once, try again later.
  bool put(const wire::HapticLaw& law) { return laws_.try_push(law); }
  // Waits while the tool touches anything: its force may not turn in a hand that holds still.
  void put_view(const Quatf& world_from_device) { views_.put(world_from_device); }
  // False: there is no newer one.
  bool take_reading(HandReading& reading) { return readings_.take(reading); }
  bool take_state(HandState& state) { return states_.take(state); }
  // The same for a thread that makes reports of it.
  bool take_report(HandState& state) { return reports_.take(state); }

  Status step(std::uint64_t now_us) override;
  bool let_go() override;
  void stop() override;

 private:
  static constexpr std::size_t kWaitingLaws = 8;

  void take_messages(std::uint64_t now_us);
  tool::Verb verb_of(const device::DeviceReading& reading);
  void feel(const device::DeviceReading& reading, std::uint64_t now_us);

  device::HapticDevice& device_;
  HandSettings settings_;
  std::optional<Fulcrum> fulcrum_;
  Workspace workspace_;
  TouchModel model_;
  Safety safety_;
  Trace* const trace_;

  Newest<wire::HapticPatch> patches_;
  SpscQueue<wire::HapticLaw> laws_;
  Newest<Quatf> views_;
  Newest<HandReading> readings_;
  Newest<HandState> states_, reports_;

  HandState state_;
  TouchOutput touch_;
  bool is_closed_ = false;                    // the gripper
  bool lets_go_ = false;                      // until it is stopped
  std::uint64_t last_us_ = 0, patch_us_ = 0;  // 0: there was none
};

}  // namespace trocar::haptics
