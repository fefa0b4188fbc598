// The first touch of a hollow organ: until the first answer a hand feels what the server expects
// of the wall's shape. Prints what it measured.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "server/organs/catalogue/builtin_organs.h"
#include "tests/feel/felt_motions.h"
#include "tests/haptics/motions.h"

namespace trocar::haptics::testing {
namespace {

constexpr double kSolid = 0.25;  // the greatest error of a solid organ's first touch

// Returns the greatest error until the first answer of the touch has come, over the peak.
double unanswered_error(const FeelRecord& record, double peak_n) {
  double greatest_n = 0;
  for (std::size_t k = 0; k < record.true_n.size() && length(record.server_n[k]) == 0; ++k)
    greatest_n = std::max(greatest_n, length(record.rendered_n[k] - record.true_n[k]));
  return greatest_n / peak_n;
}

double press_stomach(bool does_server_expect) {
  static const step::Simulation kStomach(*catalogue::make_stomach());
  Motion motion = press(139);
  motion.seconds = 1.2;
  FeelSettings settings{.line = {.rtt_s = 0.1}};
  settings.at_server = [&](wire::HapticPatch& patch, const FeltOrgan&) {
    if (patch.kind == wire::TouchKind::Near) patch.has_stiffness = does_server_expect;
  };
  const auto record = run(
      kStomach, probe(), place_on(kStomach, probe(), {0, 0, 1}), plain(motion),
      [](const auto& laws) { return make_model(probe(), laws); }, settings);
  const auto outcome = measure(measured_of(motion), record);
  const double unanswered = unanswered_error(record, outcome.peak_n);
  std::printf(
      "stomach%s: rms %.0f %%, worst %.0f %%, before the first answer %.0f %%, peak %.3f N\n",
      does_server_expect ? "" : ", nothing expected", 100 * outcome.rms, 100 * outcome.greatest,
      100 * unanswered, outcome.peak_n);
  return unanswered;
}

TEST(FeelHollow, AWallIsNoSolidBeforeTheFirstAnswer) {
  EXPECT_LT(press_stomach(true), kSolid);
  EXPECT_GT(press_stomach(false), 1);
}

}  // namespace
}  // namespace trocar::haptics::testing
