// Schemes that break a rule fail the measurement that the model passes: so the measurement sees the
// rule.

#include <gtest/gtest.h>

#include <cstdio>

#include "tests/haptics/motions.h"

namespace trocar::haptics::testing {
namespace {

constexpr Line kLine{.rtt_s = 0.1};

using Make = std::function<std::unique_ptr<Client>(const wire::HapticLaw&)>;

std::unique_ptr<Client> ours(const wire::HapticLaw& law) {
  return make_model(probe(), {law});
}

double mean_of(double Outcome::*figure, const std::function<Motion(double)>& motion,
               const Make& make) {
  double sum = 0;
  for (const Trial& trial : trials()) {
    const wire::HapticLaw law = client_law(trial.tissue, trial.guess);
    sum += run(
               motion(trial.tissue.stiffness_n_m), trial.tissue, [&] { return make(law); }, kLine).*
           figure;
  }
  return sum / static_cast<double>(trials().size());
}

Motion palpation_1hz(double stiffness_n_m) {
  return palpation(stiffness_n_m, 1);
}
Motion palpation_3hz(double stiffness_n_m) {
  return palpation(stiffness_n_m, 3);
}

constexpr double kMost1Hz = 0.04;

TEST(Mutants, TheModelPasses) {
  EXPECT_LT(mean_of(&Outcome::rms, palpation_1hz, ours), kMost1Hz);
}

TEST(Mutants, TimeOfArrivalForTimeOfEchoFails) {
  const auto mutant = [](const wire::HapticLaw& law) {
    return make_model(probe(), {law}, {}, [](wire::HapticPatch& patch, std::uint64_t now_us) {
      patch.echo_time_us = now_us;
    });
  };
  EXPECT_GT(mean_of(&Outcome::rms, palpation_1hz, mutant), 3 * kMost1Hz);
}

TEST(Mutants, NoRelaxationFails) {
  const auto mutant = [](wire::HapticLaw law) {
    law.relaxation = {};
    return make_model(probe(), {law});
  };
  EXPECT_GT(mean_of(&Outcome::rms, palpation_1hz, mutant), kMost1Hz);
}

TEST(Mutants, StiffnessOfOneTickIsWorseThanNothing) {
  const auto linear = [](const wire::HapticLaw&) { return make_linear(5); };
  EXPECT_GT(mean_of(&Outcome::rms, palpation_1hz, linear), 10 * kMost1Hz);
}

TEST(Mutants, LinearFeedsAFastHand) {
  const auto linear = [](const wire::HapticLaw&) { return make_linear(1); };
  EXPECT_GT(mean_of(&Outcome::cycle_mj, palpation_3hz, linear), 0);
  EXPECT_LT(mean_of(&Outcome::cycle_mj, palpation_3hz, ours), 0);
}

TEST(Mutants, HoldAndPenaltyFeedTheHand) {
  const auto hold = [](const wire::HapticLaw&) { return make_hold(); };
  EXPECT_GT(mean_of(&Outcome::rms, palpation_1hz, hold), 3 * kMost1Hz);
  EXPECT_GT(mean_of(&Outcome::cycle_mj, palpation_1hz, hold), 0);
  const auto penalty = [](const wire::HapticLaw&) { return make_penalty(); };
  EXPECT_GT(mean_of(&Outcome::rms, palpation_1hz, penalty), 3 * kMost1Hz);
}

TEST(Mutants, TheSafetyChainLeavesTheModelAlone) {
  const auto safe = [](const wire::HapticLaw& law) { return make_safe(ours(law)); };
  for (const auto motion : {palpation_1hz, palpation_3hz, press, release, taps})
    EXPECT_NEAR(mean_of(&Outcome::rms, motion, safe), mean_of(&Outcome::rms, motion, ours), 0.002);
}

TEST(Mutants, TheSafetyChainTakesMostOfWhatHoldFeeds) {
  const auto hold = [](const wire::HapticLaw&) { return make_hold(); };
  const auto safe = [](const wire::HapticLaw&) { return make_safe(make_hold()); };
  const double bare_mj = mean_of(&Outcome::work_mj, palpation_3hz, hold);
  const double safe_mj = mean_of(&Outcome::work_mj, palpation_3hz, safe);
  std::printf("hold, 3 Hz, RTT 100 ms: %.1f mJ, behind the safety chain %.1f mJ\n", bare_mj,
              safe_mj);
  EXPECT_GT(bare_mj, 20);
  EXPECT_LT(safe_mj, 0.2 * bare_mj);
}

}  // namespace
}  // namespace trocar::haptics::testing
