// Closed loops with the measured liver itself: what a hand feels keeps its bounds, schemes that
// break a rule do not, and what nobody can foresee does no harm. Prints what it measured.

#include <gtest/gtest.h>

#include <cstdio>

#include "server/organs/catalogue/builtin_organs.h"
#include "tests/feel/felt_motions.h"
#include "tests/haptics/motions.h"

namespace trocar::haptics::testing {
namespace {

constexpr int kTets = 6000;  // elements as large as the probe
constexpr double kLiver_n_m = 139;
constexpr double kMostStep_n = 0.3;
constexpr tool::ToolShape kBlade{
    .radius_m = 0.001f, .length_m = 0.2f, .half_width_m = 0.001f, .edge_m = 0.03f};

const step::Simulation& liver() {
  static const step::Simulation kLiver(*catalogue::make_measured_liver(kTets));
  return kLiver;
}
const Frame& place() {
  static const Frame kPlace = place_on(liver(), probe(), {0, 1, 0});
  return kPlace;
}

std::unique_ptr<Client> model(const std::vector<wire::HapticLaw>& laws) {
  return make_model(probe(), laws);
}

Outcome feel(const Motion& motion, const MakeOrganClient& make, double rtt_s = 0.1) {
  const FeelSettings settings{.line = {.rtt_s = rtt_s}};
  const auto outcome =
      measure(measured_of(motion), run(liver(), probe(), place(), plain(motion), make, settings));
  std::printf("%s, %.0f ms: rms %.1f %%, gain %.3f, %.1f deg, %.3f mJ per cycle (truth %.3f)\n",
              motion.name.c_str(), 1e3 * rtt_s, 100 * outcome.rms, outcome.gain, outcome.phase_deg,
              outcome.cycle_mj, outcome.true_cycle_mj);
  return outcome;
}

constexpr double kMost1Hz = 0.04;
const Motion& slow() {
  static const Motion kSlow = palpation(kLiver_n_m, 1);
  return kSlow;
}
const Motion& fast() {
  static const Motion kFast = palpation(kLiver_n_m, 3);
  return kFast;
}

TEST(Feel, EqualLoopsGiveEqualForces) {
  Motion motion = press(kLiver_n_m);
  motion.seconds = 0.9;
  const auto once = run(liver(), probe(), place(), plain(motion), model);
  const auto again = run(liver(), probe(), place(), plain(motion), model);
  EXPECT_EQ(once.rendered_n, again.rendered_n);
  EXPECT_EQ(once.true_n, again.true_n);
  EXPECT_GT(once.true_n.back().z, 0.1);
}

TEST(Feel, PalpationIsFelt) {
  const auto outcome = feel(slow(), model);
  EXPECT_LT(outcome.rms, kMost1Hz);
  EXPECT_NEAR(outcome.gain, 1, 0.05);
  EXPECT_NEAR(outcome.phase_deg, 0, 5);
  EXPECT_LT(outcome.cycle_mj, 0);
  EXPECT_EQ(outcome.free_n, 0);
  EXPECT_LT(outcome.step_n, kMostStep_n);
}

TEST(Feel, FastPalpationIsFelt) {
  const auto outcome = feel(fast(), model);
  EXPECT_LT(outcome.rms, 0.08);
  EXPECT_NEAR(outcome.gain, 1, 0.15);
  EXPECT_NEAR(outcome.phase_deg, 0, 20);
  EXPECT_LT(outcome.cycle_mj, 0);
}

// The model follows a server that does little as it follows one that does all.
TEST(Feel, FastPalpationIsFeltWhereTheServerHasLittleTime) {
  const auto felt = with_little_time();
  const auto outcome = measure(measured_of(felt.motion), run(liver(), probe(), place(), felt, model,
                                                             {.line = {.rtt_s = 0.05}}));
  std::printf("%s, 50 ms: rms %.1f %%, gain %.3f, %.1f deg, %.3f mJ per cycle (truth %.3f)\n",
              felt.motion.name.c_str(), 100 * outcome.rms, outcome.gain, outcome.phase_deg,
              outcome.cycle_mj, outcome.true_cycle_mj);
  EXPECT_LT(outcome.rms, 0.07);
  EXPECT_NEAR(outcome.gain, 1, 0.15);
  EXPECT_NEAR(outcome.phase_deg, 0, 20);
  EXPECT_LT(outcome.cycle_mj, 0);
}

TEST(FeelMutants, StiffnessOfOneTickFails) {
  EXPECT_GT(feel(slow(), [](const auto&) { return make_linear(5); }).rms, kMost1Hz);
}

TEST(FeelMutants, TimeOfArrivalForTimeOfEchoFails) {
  const auto mutant = [](const auto& laws) {
    return make_model(probe(), laws, {}, [](wire::HapticPatch& patch, std::uint64_t now_us) {
      patch.echo_time_us = now_us;
    });
  };
  EXPECT_GT(feel(slow(), mutant).rms, kMost1Hz);
}

TEST(FeelMutants, NoRelaxationFails) {
  const auto mutant = [](auto laws) {
    for (auto& law : laws) law.relaxation = {};
    return make_model(probe(), laws);
  };
  EXPECT_GT(feel(slow(), mutant).rms, kMost1Hz);
}

TEST(FeelMutants, LinearFeedsAFastHand) {
  EXPECT_GT(feel(fast(), [](const auto&) { return make_linear(1); }).cycle_mj, 0);
}

struct Event {
  const char* name;
  FeltMotion (*make)();
  tool::ToolShape shape = probe();
};
FeltMotion lifted() {
  return lifted_by_another(liver(), place());
}
FeltMotion refused_press() {
  return refused(place(), tool::Verb::Push);
}
FeltMotion refused_grasp() {
  return refused(place(), tool::Verb::Grasp);
}
FeltMotion refused_blade() {
  return refused(place(), tool::Verb::Cut);
}
FeltMotion plain_release() {
  return plain(release(kLiver_n_m));
}
FeltMotion plain_grasp() {
  return plain(grasp(kLiver_n_m));
}
FeltMotion plain_slide() {
  return plain(slide(kLiver_n_m));
}
FeltMotion plain_taps() {
  return plain(taps(kLiver_n_m));
}
constexpr tool::ToolShape kWeakJaws{
    .radius_m = 0.006f, .length_m = 0.2f, .reach_m = 0.008f, .grip_n = 0.8f};

class FeelEvents : public ::testing::TestWithParam<Event> {};

TEST_P(FeelEvents, DoNoHarm) {
  const auto& event = GetParam();
  const auto make = [&](const auto& laws) { return make_safe(make_model(event.shape, laws)); };
  const Frame where = event.shape == probe() ? place() : place_on(liver(), event.shape, {0, 1, 0});
  const auto felt = event.make();
  const auto record = run(liver(), event.shape, where, felt, make, {.line = {.rtt_s = 0.1}});
  const auto outcome = measure(measured_of(felt.motion), record);
  std::printf(
      "%s: rms %.1f %%, worst %.0f %%, largest step %.3f N/ms (truth %.3f), most work %.2f "
      "mJ, peak %.2f N\n",
      event.name, 100 * outcome.rms, 100 * outcome.greatest, outcome.step_n, outcome.true_step_n,
      outcome.work_mj, outcome.peak_n);
  EXPECT_GT(outcome.peak_n, 0.05) << "nothing was touched";
  EXPECT_LE(outcome.step_n, kMostStep_n + 1e-9);
  for (const Vec3d& force : record.rendered_n) ASSERT_TRUE(is_finite(force));
}

INSTANTIATE_TEST_SUITE_P(
    Each, FeelEvents,
    ::testing::Values(Event{"Release", plain_release}, Event{"Taps", plain_taps},
                      Event{"Slide", plain_slide}, Event{"Grasp", plain_grasp},
                      Event{"Lifted", lifted}, Event{"RefusedPress", refused_press},
                      Event{"RefusedGrasp", refused_grasp}, Event{"RefusedBlade", refused_blade},
                      Event{"Mark", returned_to_mark}, Event{"Reconnect", reconnected},
                      Event{"HalfPace", at_half_pace}, Event{"Slip", pulled_off, kWeakJaws},
                      Event{"Cut", cut_through, kBlade}),
    [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace trocar::haptics::testing
