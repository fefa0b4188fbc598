// The contact force of a session beside the same organ solved to a tolerance, in organs that no
// constant of the solver was chosen on. The target is 3 % of the largest force, in every tick.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "server/lab/calibration/calibrate.h"
#include "server/session/control/rate_controller.h"
#include "tests/calibration/force_organs.h"
#include "tests/support/shared.h"

namespace trocar::calibration {
namespace {

using testing::force_organs;
using testing::ForceOrgan;

constexpr double kTarget = 0.03;

// A session's controller on a machine of which each tick costs the same on every run.
class VirtualSession {
 public:
  explicit VirtualSession(const step::Simulation& simulation)
      : controller_({.highest = simulation.with_sweeps_for_organ({}),
                     .layer_sweeps = simulation.context().solve.far_plan.sweeps,
                     .most_far_sweeps = control::kMostFarSweeps}) {}

  step::TickDecisions decisions() const { return controller_.decisions(); }
  void observe(const step::TickReport& report) {
    const auto near = report.solve.node_sweeps - report.solve.far_node_sweeps;
    controller_.observe(report,
                        {kFixed_ns + kNear_ns * near + kFar_ns * report.solve.far_node_sweeps, 0});
  }

 private:
  // These are costs of tissue whose strain is averaged implicitly, the most costly, on one core.
  static constexpr std::uint64_t kFixed_ns = 60'000, kNear_ns = 120, kFar_ns = 60;
  control::RateController controller_;
};

struct Course {
  double peak_n = 0, at_peak = 0, at_end = 0, worst = 0;  // errors: shares of the peak
};

Course compare(const PressCourse& course, const PressCourse& solved) {
  Course result;
  std::size_t peak = 0;
  const auto error = [&](std::size_t i) {
    return length(course.forces_n[i]) - length(solved.forces_n[i]);
  };
  for (std::size_t i = 0; i < solved.forces_n.size(); ++i) {
    if (length(solved.forces_n[i]) > length(solved.forces_n[peak])) peak = i;
    result.worst = std::max(result.worst, std::abs(error(i)));
  }
  result.peak_n = length(solved.forces_n[peak]);
  result.at_peak = error(peak) / result.peak_n;
  result.at_end = error(solved.forces_n.size() - 1) / result.peak_n;
  result.worst /= result.peak_n;
  return result;
}

class TrueForce : public ::testing::TestWithParam<ForceOrgan> {};

TEST_P(TrueForce, OfASessionIsThatOfTheFullSolution) {
  const auto& entry = GetParam();
  if (!entry.shared_file.empty()) TROCAR_SKIP_WITHOUT_SHARED(entry.shared_file);
  const auto organ = entry.make();
  ASSERT_TRUE(organ.ok()) << organ.error().message;
  PressBench bench(*organ);
  const double radius = radius_of(*organ, {});
  const auto place = spread_places(*organ, 1, 3).front();
  for (const int speed_mm_s : {10, 40}) {
    const PressPlan plan{.radius_m = radius,
                         .depth_m = std::min(0.012, 0.4 * radius),
                         .speed_m_s = speed_mm_s * 1e-3,
                         .hold_ticks = 300};
    const auto pilot = bench.pilot(place, plan);
    const auto solved =
        bench.press(place, plan, converged_decisions(pilot.tolerance_n(bench.node_count())));
    ASSERT_TRUE(solved.convergence.is_reached()) << solved.convergence.words();
    VirtualSession session(bench.simulation());
    const auto course = bench.run(
        place, plan, [&](std::span<const double>) { return session.decisions(); },
        [&](const step::TickReport& report, const Vec3d&) { session.observe(report); });
    const auto found = compare(course, solved);
    const bool is_missed = std::ranges::count(entry.missed_at_mm_s, speed_mm_s) > 0;
    std::printf(
        "%-18s %5zu nodes %3d mm/s  peak %8.4f N  error at the peak %+5.1f %%, after the "
        "hold %+5.1f %%, worst %4.1f %%%s\n",
        entry.name.c_str(), bench.node_count(), speed_mm_s, found.peak_n, 100 * found.at_peak,
        100 * found.at_end, 100 * found.worst, is_missed ? "  MISSED" : "");
    if (!is_missed) {
      EXPECT_LT(found.worst, kTarget) << speed_mm_s << " mm/s";
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Organs, TrueForce, ::testing::ValuesIn(force_organs()));

}  // namespace
}  // namespace trocar::calibration
