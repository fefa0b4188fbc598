#include "tests/feel/felt_motions.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/haptics/motions.h"

namespace trocar::haptics::testing {
namespace {

constexpr double kLiver_n_m = 139;  // as those motions want it
constexpr double kAside_m = 0.025, kLift_m = 0.004;
constexpr tool::ToolShape kJaws{.radius_m = 0.004f, .length_m = 0.2f, .reach_m = 0.006f};

double ramp(double t, double begin, double end, double from, double to) {
  return from + (to - from) * std::clamp((t - begin) / (end - begin), 0.0, 1.0);
}

// The second hand joins at the beginning, its tool at `tip_m`, m, world frame, and grasps from
// 0.3 s on.
void move_other(double s, const Vec3d& tip_m, const Frame& place, hands::TickInputs& inputs) {
  if (s == 0) {
    hands::HandJoin join{.slot = {1}};
    join.shapes[0] = kJaws;
    inputs.joins.push_back(join);
  }
  const Pose pose{to_float(tip_m), rotation_from_z(to_float(place.z))};
  const auto verb = s < 0.3 ? tool::Verb::None : tool::Verb::Grasp;
  inputs.samples.push_back({tool_slot({1}, 0), {pose, verb}});
}

}  // namespace

FeltMotion plain(const Motion& motion) {
  FeltMotion felt{.motion = motion};
  if (motion.grasp_s >= 0)
    felt.verb = [from_s = motion.grasp_s, until_s = motion.release_s](double s) {
      return s >= from_s && s < until_s ? tool::Verb::Grasp : tool::Verb::Push;
    };
  return felt;
}

FeltMotion lifted_by_another(const step::Simulation& simulation, const Frame& place) {
  FeltMotion felt = plain(press(kLiver_n_m));
  felt.motion.steady_from_s = -1;
  const Frame other =
      place_at(simulation, kJaws, place.origin + place.to_world({kAside_m, 0, 0}), place.z);
  felt.others = [=](double s, hands::TickInputs& inputs) {
    const double up_m = s > 1.5 ? kLift_m * std::sin(2 * std::numbers::pi * (s - 1.5)) : 0;
    move_other(s, other.origin + place.z * up_m, place, inputs);
  };
  return felt;
}

FeltMotion tugged_by_another(const step::Simulation& simulation, const Frame& place) {
  constexpr double kTuggedAside_m = 0.014, kTug_m = 0.008, kTug_s = 0.1;
  FeltMotion felt = plain(press(kLiver_n_m));
  felt.motion.name = "tugged";
  felt.motion.steady_from_s = -1;
  const Frame other =
      place_at(simulation, kJaws, place.origin + place.to_world({kTuggedAside_m, 0, 0}), place.z);
  felt.others = [=](double s, hands::TickInputs& inputs) {
    const double phase_s = std::fmod(s, 1.0);
    const double up = ramp(phase_s, 0, kTug_s, 0, 1) - ramp(phase_s, 0.5, 0.5 + kTug_s, 0, 1);
    move_other(s, other.origin + place.z * (s < 1.5 ? 0 : up * kTug_m), place, inputs);
  };
  return felt;
}

FeltMotion refused(const Frame& place, tool::Verb verb) {
  FeltMotion felt = plain(press(kLiver_n_m));
  felt.motion.name = "refused";
  felt.motion.steady_from_s = -1;
  felt.verb = [=](double s) { return s < 1.5 ? tool::Verb::Push : verb; };
  felt.motion.wanted_m = [](double s) {
    return Vec3d{0, 0,
                 s < 1.8 ? ramp(s, 0.6, 1.2, 0.006, -0.004) : ramp(s, 1.8, 2.4, -0.004, -0.008)};
  };
  felt.others = [=](double s, hands::TickInputs& inputs) {
    move_other(s, place.origin, place, inputs);
  };
  return felt;
}

FeltMotion returned_to_mark() {
  FeltMotion felt = plain(press(kLiver_n_m));
  felt.motion.name = "mark";
  felt.motion.steady_from_s = -1;
  felt.others = [](double s, hands::TickInputs& inputs) {
    if (std::lround(1e3 * s) == 200) inputs.mark = hands::MarkAction::Set;
    if (std::lround(1e3 * s) == 2500) inputs.mark = hands::MarkAction::Return;
  };
  return felt;
}

FeltMotion reconnected() {
  FeltMotion felt = plain(palpation(kLiver_n_m, 1));
  felt.motion.name = "reconnect";
  felt.motion.seconds = 8;
  felt.gone_s = 2;
  felt.back_s = 5;
  return felt;
}

FeltMotion at_half_pace() {
  FeltMotion felt = plain(palpation(kLiver_n_m, 1));
  felt.motion.name = "half pace";
  felt.server_pace = 0.5;
  return felt;
}

FeltMotion with_little_time() {
  FeltMotion felt = plain(palpation(kLiver_n_m, 3));
  felt.motion.name = "3 Hz, little time";
  felt.decisions.sweeps = 2;
  felt.decisions.layer_sweeps = {1, 1, 1};
  felt.decisions.far_interval = 2;
  return felt;
}

namespace {

FeltMotion pulled_to(double far_m) {
  FeltMotion felt;
  felt.motion = {.name = "pull",
                 .seconds = 4,
                 .wanted_m =
                     [far_m](double s) {
                       return Vec3d{0, 0,
                                    s < 1.2 ? ramp(s, 0.3, 0.7, 0.006, -0.002)
                                            : ramp(s, 1.2, 3.2, -0.002, far_m)};
                     },
                 .grasp_s = 1};
  felt.verb = [](double s) { return s < 1 ? tool::Verb::Push : tool::Verb::Grasp; };
  return felt;
}

}  // namespace

FeltMotion pulled_off() {
  return pulled_to(0.04);
}
FeltMotion torn_off() {
  return pulled_to(0.06);
}

FeltMotion cut_through() {
  FeltMotion felt;
  felt.motion = {.name = "cut", .seconds = 4, .wanted_m = [](double s) {
                   const double z =
                       s < 3 ? ramp(s, 0.5, 1.5, 0.006, -0.010) : ramp(s, 3, 3.5, -0.010, 0.010);
                   return Vec3d{ramp(s, 1.7, 2.7, 0, 0.020), 0, z};
                 }};
  felt.verb = [](double) { return tool::Verb::Cut; };
  return felt;
}

}  // namespace trocar::haptics::testing
