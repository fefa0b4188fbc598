// Hands feel while things change at the server: tissue is cut, it tears, and another hand tugs at
// it. This prints what it measured.

#include <gtest/gtest.h>

#include <cstdio>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/organ/average_strain.h"
#include "tests/feel/felt_motions.h"
#include "tests/haptics/motions.h"

namespace trocar::haptics::testing {
namespace {

constexpr int kTets = 6000;
constexpr double kRtt_s = 0.1;
// A change of the tissue is felt so much later than the round trip.
constexpr double kLate_s = 0.08;
constexpr double kRight = 0.15;  // an error over the peak
constexpr double kMostStep_n = 0.3;

organ::Organ liver_organ() {
  return *catalogue::make_measured_liver(kTets);
}
// A tug of softer tissue, whose strain is averaged, does not tell the mutant apart.
organ::Organ plain_organ() {
  auto organ = liver_organ();
  organ::use_plain_strain(organ);
  return organ;
}
const step::Simulation& liver() {
  static const step::Simulation kLiver(liver_organ());
  return kLiver;
}

FeelRecord feel(const step::Simulation& simulation, const Frame& place, const FeltMotion& motion,
                const tool::ToolShape& shape, FeelSettings settings = {},
                const TouchSettings& model = {}) {
  settings.line.rtt_s = kRtt_s;
  return run(
      simulation, shape, place, motion,
      [&](const auto& laws) { return make_model(shape, laws, model); }, settings);
}

void print(const char* what, const Outcome& outcome) {
  std::printf(
      "%s: rms %.1f %%, worst %.0f %%, largest step %.3f N/ms (truth %.3f), gain %.3f, "
      "peak %.2f N\n",
      what, 100 * outcome.rms, 100 * outcome.greatest, outcome.step_n, outcome.true_step_n,
      outcome.gain, outcome.peak_n);
}

TEST(FeltChanges, ABladeIsHeldBackAsInTheTissue) {
  constexpr tool::ToolShape kBlade{
      .radius_m = 0.001f, .length_m = 0.2f, .half_width_m = 0.001f, .edge_m = 0.03f};
  // The truth's blade takes each step of the encoder within a tick, and would rest between them.
  const FeelSettings fine{.hand = {.encoder_m = 1e-6}};
  const auto felt = cut_through();
  const Frame place = place_on(liver(), kBlade, {0, 1, 0});
  const auto outcome = measure(measured_of(felt.motion), feel(liver(), place, felt, kBlade, fine));
  print("cut", outcome);
  EXPECT_GT(outcome.peak_n, 1);
  EXPECT_LT(outcome.rms, 0.08);
  EXPECT_LT(outcome.greatest, 0.4);
  EXPECT_LT(outcome.step_n, 0.06);
  EXPECT_EQ(outcome.free_n, 0);
  EXPECT_LT(outcome.work_mj, 1);
}

// The jaws hold more than the tissue does, so it tears: the true force jumps within a tick.
// The model follows a round trip later, and the safety chain lets no such step through.
TEST(FeltChanges, TissueThatTearsLetsTheHandGo) {
  constexpr tool::ToolShape kJaws{
      .radius_m = 0.006f, .length_m = 0.2f, .reach_m = 0.008f, .grip_n = 8};
  organ::Organ organ = liver_organ();
  organ.material.tear_stretch = 1.3;
  const step::Simulation tearing(std::move(organ));
  bool has_torn = false;
  constexpr double kHeld_n = 0.4;  // less than an error that is told
  // The server's tissue holds the tool, or has let it go at this pose, ms: the first that an answer
  // without its hold is about.
  bool is_held = false;
  std::size_t let_go_at = 0;
  FeelSettings settings;
  settings.at_server = [&](wire::HapticPatch& patch, const FeltOrgan& server) {
    EXPECT_TRUE(server.simulation().state().cuts.can_tear());
    has_torn |= !server.simulation().state().cuts.history().empty();
    const bool was_held = is_held;
    is_held = length(patch.force_n) > static_cast<float>(kHeld_n);
    if (was_held && !is_held) let_go_at = (patch.echo_time_us - kClockStart_us) / 1000;
  };
  const auto felt = torn_off();
  settings.line.rtt_s = kRtt_s;
  const auto safe = [&](const auto& laws) { return make_safe(make_model(kJaws, laws)); };
  const auto record =
      run(tearing, kJaws, place_on(tearing, kJaws, {0, 1, 0}), felt, safe, settings);
  const auto outcome = measure(measured_of(felt.motion), record);
  print("tear", outcome);
  EXPECT_GT(outcome.peak_n, 2);
  EXPECT_TRUE(has_torn);
  EXPECT_FALSE(is_held);
  EXPECT_GT(outcome.true_step_n, kMostStep_n) << "it tears at once";
  EXPECT_LE(outcome.step_n, kMostStep_n + 1e-9);
  // The server's tissue tears in steps of its own, as the smallest difference decides where.
  std::size_t torn = let_go_at;
  for (std::size_t k = 0; k < record.true_n.size(); ++k)
    if (length(record.true_n[k]) > kHeld_n) torn = std::max(torn, k);
  const auto right = torn + static_cast<std::size_t>((kRtt_s + kLate_s) / kDt_s);
  ASSERT_LT(right + 100, record.true_n.size()) << "it has not torn";
  for (std::size_t k = right; k < record.true_n.size(); ++k)
    ASSERT_LT(length(record.rendered_n[k] - record.true_n[k]), kRight * outcome.peak_n) << k;
}

// The model moves what it said along with the surface. Else the surface's motion would count twice.
TEST(FeltChanges, AReferenceThatIsNotMadeAgainFails) {
  const step::Simulation tissue(plain_organ());
  const Frame place = place_on(tissue, probe(), {0, 1, 0});
  const auto felt = tugged_by_another(tissue, place);
  const auto tug = [&](double moved_share) {
    const auto record =
        feel(tissue, place, felt, probe(), {}, TouchSettings{.moved_share = moved_share});
    const auto outcome = measure(measured_of(felt.motion), record);
    print(moved_share > 0 ? "tugged" : "tugged, without a new reference", outcome);
    return outcome;
  };
  const auto outcome = tug(1), mutant = tug(0);
  EXPECT_LT(outcome.step_n, outcome.true_step_n);
  EXPECT_GT(mutant.step_n, mutant.true_step_n) << "it jerks more than the tissue does";
  EXPECT_GT(mutant.rms, outcome.rms);
}

}  // namespace
}  // namespace trocar::haptics::testing
