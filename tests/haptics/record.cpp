#include "tests/haptics/record.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

namespace trocar::haptics::testing {
namespace {

constexpr double kStep_s = 0.001;
constexpr double kStartUp_s = 0.3;
constexpr double kClearOfTissue_m = 0.002;

void measure_cycles(const Measured& measured, const Record& record, Outcome& outcome) {
  const std::size_t count = record.tip_m.size();
  const double cycles =
      std::floor((static_cast<double>(count) * kStep_s - 1.5) * measured.frequency_hz);
  const std::size_t first =
      count - static_cast<std::size_t>(std::round(cycles / measured.frequency_hz / kStep_s));
  std::complex<double> rendered, truth;
  for (std::size_t k = first; k < count; ++k) {
    const double angle =
        2 * std::numbers::pi * measured.frequency_hz * static_cast<double>(k) * kStep_s;
    rendered += record.rendered_n[k].z * std::polar(1.0, -angle);
    truth += record.true_n[k].z * std::polar(1.0, -angle);
    const Vec3d way_m = record.tip_m[k] - record.tip_m[k - 1];
    outcome.cycle_mj += dot(record.rendered_n[k - 1], way_m) * 1e3 / cycles;
    outcome.true_cycle_mj += dot(record.true_n[k - 1], way_m) * 1e3 / cycles;
  }
  outcome.gain = std::abs(rendered) / std::abs(truth);
  outcome.phase_deg = std::arg(rendered / truth) * 180 / std::numbers::pi;
}

void measure_steady(const Measured& measured, const Record& record, Outcome& outcome) {
  const std::size_t count = record.tip_m.size();
  const auto first = static_cast<std::size_t>(measured.steady_from_s / kStep_s);
  double rendered = 0, truth = 0, height = 0, wobble = 0;
  for (std::size_t k = first; k < count; ++k) {
    rendered += record.rendered_n[k].z;
    truth += record.true_n[k].z;
    height += record.tip_m[k].z / static_cast<double>(count - first);
  }
  for (std::size_t k = first; k < count; ++k)
    wobble += (record.tip_m[k].z - height) * (record.tip_m[k].z - height);
  outcome.steady = rendered / truth - 1;
  outcome.wobble_m = std::sqrt(wobble / static_cast<double>(count - first));
}

}  // namespace

Outcome measure(const Measured& measured, const Record& record) {
  Outcome outcome;
  const std::size_t count = record.tip_m.size();
  for (const Vec3d& f : record.true_n) outcome.peak_n = std::max(outcome.peak_n, length(f));
  double sum = 0, work_mj = 0;
  for (std::size_t k = 1; k < count; ++k) {
    const double s = static_cast<double>(k) * kStep_s;
    const double miss_n = length(record.rendered_n[k] - record.true_n[k]);
    if (s >= kStartUp_s) sum += miss_n * miss_n;
    if (s >= kStartUp_s) outcome.greatest = std::max(outcome.greatest, miss_n / outcome.peak_n);
    outcome.step_n =
        std::max(outcome.step_n, length(record.rendered_n[k] - record.rendered_n[k - 1]));
    outcome.true_step_n =
        std::max(outcome.true_step_n, length(record.true_n[k] - record.true_n[k - 1]));
    work_mj += dot(record.rendered_n[k - 1], record.tip_m[k] - record.tip_m[k - 1]) * 1e3;
    outcome.work_mj = std::max(outcome.work_mj, work_mj);
    if (record.tip_m[k].z > kClearOfTissue_m && measured.is_free)
      outcome.free_n = std::max(outcome.free_n, length(record.rendered_n[k]));
    if (record.cut_s >= 0 && outcome.recovery_s < 0 && s > record.cut_s + 0.003 &&
        miss_n < 0.15 * measured.cut_n)
      outcome.recovery_s = s - record.cut_s;
  }
  outcome.rms =
      std::sqrt(sum / (static_cast<double>(count) - kStartUp_s / kStep_s)) / outcome.peak_n;
  if (measured.frequency_hz > 0) measure_cycles(measured, record, outcome);
  if (measured.steady_from_s >= 0) measure_steady(measured, record, outcome);
  return outcome;
}

}  // namespace trocar::haptics::testing
