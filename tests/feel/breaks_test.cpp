// Something ends that a hand cannot foresee while it presses or pulls: a claim, the organ as it
// was, the instrument, a hold, the connection. One law for all: no force in a hand changes by more
// than 0.3 N in a millisecond. Prints what it measured.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/session/participants/held_tools.h"
#include "tests/feel/feel_loop.h"
#include "tests/feel/whole_hand.h"

namespace trocar::haptics::testing {
namespace {

constexpr int kTets = 3000;
constexpr double kMostStep_n = 0.3;
constexpr double kBreak_s = 2.5, kEnd_s = 4;
const ToolSlot kTool = tool_slot({0}, 0), kOther = tool_slot({1}, 0);
constexpr tool::ToolShape kBall{.radius_m = 0.006f, .length_m = 0.2f};
constexpr tool::ToolShape kJaws{
    .radius_m = 0.006f, .length_m = 0.2f, .reach_m = 0.008f, .grip_n = 20};
constexpr tool::ToolShape kWeakJaws{
    .radius_m = 0.006f, .length_m = 0.2f, .reach_m = 0.008f, .grip_n = 3};

// Firm, as a hand that leans on something feels several newtons.
const step::Simulation& firm() {
  static const step::Simulation kFirm = [] {
    auto organ = *catalogue::make_liver(kTets);
    organ.material.young_modulus_pa = 30'000;
    return step::Simulation(std::move(organ));
  }();
  return kFirm;
}
const Frame& place() {
  static const Frame kPlace = place_on(firm(), kBall, {0, 1, 0});
  return kPlace;
}

double ramp(double t, double begin, double end, double from, double to) {
  return from + (to - from) * std::clamp((t - begin) / (end - begin), 0.0, 1.0);
}
bool is_at(double s, double moment_s) {
  return std::lround(1e3 * s) == std::lround(1e3 * moment_s);
}

FeltMotion pressing() {
  FeltMotion felt;
  felt.motion = {.name = "press", .seconds = kEnd_s, .wanted_m = [](double s) {
                   return Vec3d{0, 0, ramp(s, 0.6, 1.2, 0.006, -0.016)};
                 }};
  felt.verb = [](double) { return tool::Verb::Push; };
  return felt;
}
FeltMotion pulling() {
  FeltMotion felt;
  felt.motion = {.name = "pull", .seconds = kEnd_s, .wanted_m = [](double s) {
                   const double z =
                       s < 1.2 ? ramp(s, 0.3, 0.7, 0.006, -0.002) : ramp(s, 1.2, 2.2, -0.002, 0.02);
                   return Vec3d{ramp(s, 1.2, 2.2, 0, 0.01), 0, z};
                 }};
  felt.verb = [](double s) { return s < 1 ? tool::Verb::Push : tool::Verb::Grasp; };
  return felt;
}

// The second hand joins at the beginning, with its tool at `tip_m`, surface coordinates.
void move_other(double s, const Vec3d& tip_m, tool::Verb verb, hands::TickInputs& inputs,
                const tool::ToolShape& shape = kJaws) {
  if (s == 0) {
    hands::HandJoin join{.slot = {1}};
    join.shapes[0] = shape;
    inputs.joins.push_back(join);
  }
  const Pose pose{to_float(place().origin + place().to_world(tip_m)),
                  rotation_from_z(to_float(place().z))};
  inputs.samples.push_back({kOther, {pose, verb}});
}

// An instructor does this with the first hand at the break, as a session lets it be done.
FeltMotion told(FeltMotion felt, void (*tell)(participants::HeldTools&)) {
  felt.given = [held = std::make_shared<participants::HeldTools>(), is_told = false, tell](
                   double s, const hands::ToolInput& wanted) mutable {
    if (s >= kBreak_s && !is_told) tell(*held);
    is_told |= s >= kBreak_s;
    if (s >= kBreak_s + 1) held->release({0});
    return held->apply(wanted, static_cast<std::uint64_t>(s * 1e9));
  };
  return felt;
}
void freeze(participants::HeldTools& held) {
  held.freeze({0});
}
void open_jaws(participants::HeldTools& held) {
  held.open({0});
}

// ---- a: a claim is refused or ends ----

// Another hand holds the tissue; the tool presses what it holds, and then wants to hold it too.
FeltMotion refused_grasp() {
  FeltMotion felt = pressing();
  felt.verb = [](double s) { return s < kBreak_s ? tool::Verb::Push : tool::Verb::Grasp; };
  felt.others = [](double s, hands::TickInputs& inputs) {
    move_other(s, {}, s < 0.3 ? tool::Verb::None : tool::Verb::Grasp, inputs);
  };
  return felt;
}
// Another hand holds the tissue under the tool until the break.
FeltMotion holder_lets_go() {
  FeltMotion felt = pressing();
  felt.others = [](double s, hands::TickInputs& inputs) {
    const bool holds = s >= 0.3 && s < kBreak_s;
    move_other(s, {}, holds ? tool::Verb::Grasp : tool::Verb::None, inputs);
  };
  return felt;
}
// Another hand takes the tissue that the tool presses.
FeltMotion taken_by_another() {
  FeltMotion felt = pressing();
  felt.others = [](double s, hands::TickInputs& inputs) {
    move_other(s, {0.004, 0, -0.002}, s < kBreak_s ? tool::Verb::None : tool::Verb::Grasp, inputs);
  };
  return felt;
}
FeltMotion frozen_press() {
  return told(pressing(), freeze);
}
FeltMotion frozen_pull() {
  return told(pulling(), freeze);
}
FeltMotion opened_pull() {
  return told(pulling(), open_jaws);
}
// The server has no time for a tool this fast: it waits.
FeltMotion waiting(FeltMotion felt) {
  felt.decides = [](double s, step::TickDecisions& decisions) {
    if (s >= 0.9 && s < 1.4) decisions.waiting_tools = 1u << kTool.value;
    if (s >= kBreak_s && s < 3) decisions.waiting_tools = 1u << kTool.value;
  };
  return felt;
}
FeltMotion waiting_press() {
  return waiting(pressing());
}
FeltMotion waiting_pull() {
  return waiting(pulling());
}

// ---- b: the organ is what it was when it was marked ----

FeltMotion returned(FeltMotion felt, double mark_s) {
  felt.others = [mark_s](double s, hands::TickInputs& inputs) {
    if (is_at(s, mark_s)) inputs.mark = hands::MarkAction::Set;
    if (is_at(s, kBreak_s)) inputs.mark = hands::MarkAction::Return;
  };
  return felt;
}
FeltMotion returned_press() {
  return returned(pressing(), 0.2);
}
FeltMotion returned_pull() {
  return returned(pulling(), 0.2);
}
// Another hand had lifted the tissue when it was marked, so it is suddenly higher.
FeltMotion returned_to_lifted() {
  FeltMotion felt = pressing();
  felt.motion.wanted_m = [](double s) {
    return Vec3d{0, 0, s < 1 ? 0.04 : ramp(s, 1.4, 2, 0.04, -0.012)};
  };
  felt.others = [](double s, hands::TickInputs& inputs) {
    if (is_at(s, 0.9)) inputs.mark = hands::MarkAction::Set;
    if (is_at(s, kBreak_s)) inputs.mark = hands::MarkAction::Return;
    const double up_m = ramp(s, 0.3, 0.7, 0, 0.015);
    const auto verb = s < 0.2 || s > 0.95 ? tool::Verb::None : tool::Verb::Grasp;
    move_other(s, {0.016, 0, s < 1 ? up_m : 0.03}, verb, inputs);
  };
  return felt;
}

// ---- c: another instrument ----

FeltMotion changed(FeltMotion felt, const tool::ToolShape& shape) {
  felt.others = [shape](double s, hands::TickInputs& inputs) {
    if (is_at(s, kBreak_s)) inputs.changes.push_back({kTool, shape});
  };
  return felt;
}
FeltMotion thinner_press() {
  return changed(pressing(), {.radius_m = 0.002f, .length_m = 0.2f});
}
FeltMotion thicker_press() {
  return changed(pressing(), {.radius_m = 0.012f, .length_m = 0.2f});
}
FeltMotion probe_for_jaws() {
  return changed(pulling(), {.radius_m = 0.005f, .length_m = 0.2f, .form = tool::Form::Probe});
}
// The hand gives what it holds to another one, and gets that one's instrument.
FeltMotion handed_over() {
  FeltMotion felt = pulling();
  auto held = std::make_shared<participants::HeldTools>();
  felt.given = [held](double s, const hands::ToolInput& wanted) {
    if (is_at(s, kBreak_s)) held->hand_over({kTool, kOther});
    return held->apply(wanted, static_cast<std::uint64_t>(s * 1e9));
  };
  felt.others = [](double s, hands::TickInputs& inputs) {
    if (is_at(s, kBreak_s)) inputs.handover = hands::Handover{kTool, kOther};
    move_other(s, {0.05, 0, 0.05}, tool::Verb::None, inputs, kBall);
  };
  return felt;
}

// ---- d: a hold is lost ----

FeltMotion slips() {
  FeltMotion felt = pulling();
  felt.motion.wanted_m = [](double s) {
    return Vec3d{0, 0,
                 s < 1.2 ? ramp(s, 0.3, 0.7, 0.006, -0.002) : ramp(s, 1.2, 3.2, -0.002, 0.05)};
  };
  return felt;
}

// ---- e: the connection is lost and comes back ----

FeltMotion gone(FeltMotion felt) {
  felt.motion.seconds = 5;
  felt.gone_s = kBreak_s;
  felt.back_s = 4;
  return felt;
}
FeltMotion gone_press() {
  return gone(pressing());
}
FeltMotion gone_pull() {
  return gone(pulling());
}
// Meanwhile another hand takes what it held.
FeltMotion taken_over() {
  FeltMotion felt = gone(pulling());
  felt.others = [](double s, hands::TickInputs& inputs) {
    move_other(s, {0.008, 0, 0.012}, s < 3 ? tool::Verb::None : tool::Verb::Grasp, inputs);
  };
  return felt;
}

struct Break {
  const char* name;
  FeltMotion (*make)();
  tool::ToolShape shape;
};

class FeltBreaks : public ::testing::TestWithParam<Break> {};

FeltSteps feel(const Break& what, const SafetySettings& safety = {}) {
  FeltSteps steps;
  const auto make = [&](const auto& laws) { return make_hand(what.shape, laws, steps, safety); };
  const auto record =
      run(firm(), what.shape, place(), what.make(), make, {.line = {.rtt_s = 0.05}});
  for (const Vec3d& force : record.rendered_n) EXPECT_TRUE(is_finite(force));
  return steps;
}

TEST_P(FeltBreaks, ChangeNoForceByMoreThanAHandBears) {
  const auto& what = GetParam();
  const auto steps = feel(what);
  std::printf("%s: peak %.2f N, largest step %.3f N/ms (of the model %.3f)\n", what.name,
              steps.largest_n, steps.hand_n, steps.model_n);
  EXPECT_GT(steps.largest_n, 2) << "too little was felt";
  EXPECT_LE(steps.hand_n, kMostStep_n + 1e-9);
}

INSTANTIATE_TEST_SUITE_P(
    Each, FeltBreaks,
    ::testing::Values(
        Break{"RefusedGrasp", refused_grasp, kJaws}, Break{"HolderLetsGo", holder_lets_go, kBall},
        Break{"TakenByAnother", taken_by_another, kBall}, Break{"FrozenPress", frozen_press, kBall},
        Break{"FrozenPull", frozen_pull, kJaws}, Break{"OpenedPull", opened_pull, kJaws},
        Break{"WaitingPress", waiting_press, kBall}, Break{"WaitingPull", waiting_pull, kJaws},
        Break{"ReturnedPress", returned_press, kBall}, Break{"ReturnedPull", returned_pull, kJaws},
        Break{"ReturnedToLifted", returned_to_lifted, kBall},
        Break{"ThinnerPress", thinner_press, kBall}, Break{"ThickerPress", thicker_press, kBall},
        Break{"ProbeForJaws", probe_for_jaws, kJaws}, Break{"HandedOver", handed_over, kJaws},
        Break{"Slips", slips, kWeakJaws}, Break{"GonePress", gone_press, kBall},
        Break{"GonePull", gone_pull, kJaws}, Break{"TakenOver", taken_over, kJaws}),
    [](const auto& test) { return std::string(test.param.name); });

// Tissue that was held is gone at once, and the model says so: only the safety chain keeps the law.
// While nobody answers it is the fade that does.
TEST(FeltBreaksMutants, WithoutLimitsHandsAreJerked) {
  SafetySettings no_slew;
  no_slew.slew_n_s = 1e9;
  for (const auto& what :
       {Break{"OpenedPull", opened_pull, kJaws}, Break{"ReturnedPull", returned_pull, kJaws},
        Break{"ProbeForJaws", probe_for_jaws, kJaws}, Break{"Slips", slips, kWeakJaws}})
    EXPECT_GT(feel(what, no_slew).hand_n, 1) << what.name;
  SafetySettings no_fade = no_slew;
  no_fade.patch_age_s = 1e9;
  EXPECT_GT(feel({"TakenOver", taken_over, kJaws}, no_fade).hand_n, 1);
}

}  // namespace
}  // namespace trocar::haptics::testing
