// The model in the closed loop with tissues whose law it does not have, by round-trip time: errors,
// as means over the tissues, and what must hold for each of them. Prints what it measured.

#include <gtest/gtest.h>

#include <cstdio>

#include "tests/haptics/motions.h"

namespace trocar::haptics::testing {
namespace {

// Holds what the worst tissue of a motion does, and the mean error of all.
struct Worst {
  double rms = 0, gain_error = 0, phase_deg = 0, steady = 0;
  double work_mj = 0, cycle_mj = -1e9, step_n = 0, free_n = 0, recovery_s = 0;
};

using MakeMotion = Motion (*)(double stiffness_n_m);

Worst measure_all(const std::function<Motion(double)>& make_motion, double rtt_s) {
  Worst worst;
  for (const Trial& trial : trials()) {
    const wire::HapticLaw law = client_law(trial.tissue, trial.guess);
    const Outcome outcome = run(make_motion(trial.tissue.stiffness_n_m), trial.tissue,
                                [&] { return make_model(probe(), {law}); }, {.rtt_s = rtt_s});
    worst.rms += outcome.rms / static_cast<double>(trials().size());
    worst.gain_error = std::max(worst.gain_error, std::abs(outcome.gain - 1));
    worst.phase_deg = std::max(worst.phase_deg, std::abs(outcome.phase_deg));
    worst.steady = std::max(worst.steady, std::abs(outcome.steady));
    worst.work_mj = std::max(worst.work_mj, outcome.work_mj);
    worst.cycle_mj = std::max(worst.cycle_mj, outcome.cycle_mj);
    worst.step_n = std::max(worst.step_n, outcome.step_n);
    worst.free_n = std::max(worst.free_n, outcome.free_n);
    worst.recovery_s =
        outcome.recovery_s < 0 ? 1e9 : std::max(worst.recovery_s, outcome.recovery_s);
  }
  return worst;
}

// Errors in % that a round-trip time allows.
struct Bounds {
  double rtt_s;
  double press, slow, one_hz, three_hz, taps, slide, grasp, release, topology, lifted;
  double gain_1hz, phase_1hz;
};

class ClosedLoop : public ::testing::TestWithParam<Bounds> {};

TEST_P(ClosedLoop, FollowsTheTruth) {
  const Bounds& bounds = GetParam();
  std::printf("RTT %3.0f ms, rms error in %%:", bounds.rtt_s * 1e3);
  const auto check = [&](const char* name, const std::function<Motion(double)>& motion,
                         double most) {
    const Worst worst = measure_all(motion, bounds.rtt_s);
    std::printf(" %s %.1f", name, worst.rms * 100);
    EXPECT_LT(worst.rms * 100, most) << name;
    EXPECT_LT(worst.work_mj, 1) << name;
    EXPECT_LT(worst.step_n, 0.3) << name;
    EXPECT_EQ(worst.free_n, 0) << name;
    return worst;
  };
  EXPECT_LT(check("press", press, bounds.press).steady, 0.01);
  const auto palpate = [](double frequency_hz) {
    return [=](double stiffness_n_m) { return palpation(stiffness_n_m, frequency_hz); };
  };
  const Worst slow = check("0.5 Hz", palpate(0.5), bounds.slow);
  const Worst one = check("1 Hz", palpate(1), bounds.one_hz);
  const Worst three = check("3 Hz", palpate(3), bounds.three_hz);
  check("taps", taps, bounds.taps);
  check("slide", slide, bounds.slide);
  check("grasp", grasp, bounds.grasp);
  check("release", release, bounds.release);
  EXPECT_LT(check("topology", topology, bounds.topology).step_n, 0.06);
  check("lifted", lifted, bounds.lifted);
  std::printf("; 1 Hz gain %.3f, %.1f deg, 3 Hz %.3f, %.1f deg\n", one.gain_error, one.phase_deg,
              three.gain_error, three.phase_deg);
  EXPECT_LT(one.gain_error, bounds.gain_1hz);
  EXPECT_LT(one.phase_deg, bounds.phase_1hz);
  EXPECT_LT(three.gain_error, 0.15);
  EXPECT_LT(three.phase_deg, 20);
  // It takes energy from the hand in each cycle.
  EXPECT_LT(slow.cycle_mj, 0);
  EXPECT_LT(one.cycle_mj, 0);
  EXPECT_LT(three.cycle_mj, 0);
}

INSTANTIATE_TEST_SUITE_P(
    RoundTrip, ClosedLoop,
    ::testing::Values(Bounds{0, 2, 1, 1.2, 2.5, 5, 2.5, 5, 2, 7, 4.5, 0.03, 3},
                      Bounds{0.025, 3, 1.5, 1.8, 3.5, 6, 3.5, 6.5, 3, 8, 6, 0.03, 3},
                      Bounds{0.05, 5, 2, 3, 7, 6, 5, 8, 4, 9, 8, 0.03, 3},
                      Bounds{0.1, 8, 3, 4, 8, 6, 9, 12, 6, 12, 11, 0.05, 5},
                      Bounds{0.15, 14, 4, 6, 9, 6.5, 13, 17, 8, 14, 13, 0.08, 6}),
    [](const auto& each) {
      return "Ms" + std::to_string(static_cast<int>(each.param.rtt_s * 1e3 + 0.5));
    });

TEST(ClosedLoop, LossesChangeLittle) {
  const Trial trial = trials()[0];
  const wire::HapticLaw law = client_law(trial.tissue, trial.guess);
  const auto measure = [&](double loss) {
    return run(palpation(trial.tissue.stiffness_n_m, 1), trial.tissue,
               [&] { return make_model(probe(), {law}); }, {.rtt_s = 0.05, .loss = loss})
        .rms;
  };
  EXPECT_NEAR(measure(0.05), measure(0), 0.005);
}

TEST(ClosedLoop, ARefusalStops) {
  for (const double rtt_s : {0.0, 0.05, 0.1, 0.15}) {
    const Worst worst = measure_all(refusal, rtt_s);
    std::printf("refusal, RTT %3.0f ms: step %.3f N/ms, work %.2f mJ\n", rtt_s * 1e3, worst.step_n,
                worst.work_mj);
    EXPECT_LT(worst.step_n, 0.12);
    EXPECT_LT(worst.work_mj, 1);
  }
}

TEST(ClosedLoop, ACutShowsWithTheAnswer) {
  for (const double rtt_s : {0.0, 0.025, 0.05, 0.1, 0.15}) {
    const double recovery_s = measure_all([](double) { return cut(); }, rtt_s).recovery_s;
    std::printf("cut, RTT %3.0f ms: right after %.0f ms\n", rtt_s * 1e3, recovery_s * 1e3);
    EXPECT_LT(recovery_s, rtt_s + 0.08);
  }
}

TEST(ClosedLoop, IsStableWithAnyHand) {
  const Hand loose{.mass_kg = 0.08, .stiffness_n_m = 80, .damping_n_s_m = 1.2, .reflex_n_m = 0};
  const Hand barely{.mass_kg = 0.08, .stiffness_n_m = 20, .damping_n_s_m = 0.3, .reflex_n_m = 0};
  const Hand firm{.mass_kg = 0.4, .stiffness_n_m = 1500, .damping_n_s_m = 15};
  const Hand quick_reflex{.reflex_n_m = 200, .reflex_s = 0.03};
  const Hand slow_reflex{.reflex_n_m = 150, .reflex_s = 0.15};
  double worst_wobble_m = 0, worst_work_mj = 0;
  for (const double stiffness_n_m : {100.0, 500.0, 1000.0}) {
    const TissueFigures tissue{.exponent = 1.4, .stiffness_n_m = stiffness_n_m};
    const wire::HapticLaw law = client_law(tissue, 1.3);
    for (const Hand& hand : {Hand{}, loose, barely, firm, quick_reflex, slow_reflex})
      for (const double rtt_s : {0.0, 0.05, 0.1, 0.15}) {
        const Outcome outcome = run(
            press(stiffness_n_m), tissue, [&] { return make_model(probe(), {law}); },
            {.rtt_s = rtt_s}, hand);
        worst_wobble_m = std::max(worst_wobble_m, outcome.wobble_m);
        worst_work_mj = std::max(worst_work_mj, outcome.work_mj);
      }
  }
  std::printf("72 hands and tissues: wobble to %.0f um, work to %.3f mJ\n", worst_wobble_m * 1e6,
              worst_work_mj);
  EXPECT_LT(worst_wobble_m, 1e-4);
  EXPECT_LT(worst_work_mj, 1);
}

}  // namespace
}  // namespace trocar::haptics::testing
