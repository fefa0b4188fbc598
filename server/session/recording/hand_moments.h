#pragma once

// These are the moments that the hand of one tool has felt, over the time of the simulation. Its
// client has a clock of its own; each report in a recording says which time of that clock the
// tool's pose had in one tick. So the force of a tick meets what the hand felt at the same pose.
//
//   tick -> client's time of the pose in it, between two reports -> moments around that time
//
// A clock that goes back is that of another client: its moments are not mixed with those of before.
// One thread.

#include <optional>
#include <string>
#include <vector>

#include "common/wire/hand_report.h"

namespace trocar::recording {

struct FeltMoment {
  Vec3f hand_force_n, model_force_n;  // world frame
  std::uint32_t limits = 0;           // bits, as in wire::HandReport
  float answer_age_s = 0, echo_delay_s = 0, rate_hz = 0, motion_scale = 1, force_scale = 1;
  std::string device;
};

class HandMoments {
 public:
  // Call it in the order of the recording.
  void add(const wire::HandRecord& record);
  // Between the two moments around the pose of that tick; nothing: there are none close to it.
  std::optional<FeltMoment> at(Tick tick) const;

 private:
  struct Moment {
    wire::HandReport::Moment felt;
    std::size_t report = 0;  // its number
  };
  struct Report {
    float echo_delay_s = 0, rate_hz = 0, motion_scale = 1, force_scale = 1;
    std::size_t device = 0;  // of devices_
  };
  struct Anchor {  // of a client's clock in the session
    Tick tick = 0;
    std::uint64_t echo_time_us = 0;
    std::size_t run = 0;  // of runs_
  };
  struct Run {                       // of one client's clock
    std::size_t first = 0, end = 0;  // of moments_
  };

  // The client's time of the pose that the tool had in that tick, and the run that it is of.
  struct PoseTime {
    double us = 0;
    std::size_t run = 0;
  };
  std::optional<PoseTime> pose_time(Tick tick) const;

  std::vector<Moment> moments_;
  std::vector<Report> reports_;
  std::vector<Anchor> anchors_;  // by tick
  std::vector<Run> runs_;
  std::vector<std::string> devices_{""};
};

}  // namespace trocar::recording
