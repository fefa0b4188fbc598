#include "common/lesson/skill.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

namespace trocar::lesson {
namespace {

constexpr double kGapS = 0.1;           // between two samples: it was away
constexpr double kStillM_s = 0.005;     // slower is not moving
constexpr double kMovementM_s = 0.010;  // faster is a movement
constexpr double kRestS = 0.3;          // as long a rest or a movement lasts at least
constexpr double kTouchN = 0.05;        // less is not a touch
constexpr double kSmoothingS = 0.05;    // over which speed is taken
constexpr double kCutOffHz = 10, kLeastAmplitude = 0.05;

using Sample = Track::Sample;

// Speeds of one stretch without gaps, each over kSmoothingS around its sample.
std::vector<double> speeds_of(const std::vector<Sample>& stretch) {
  std::vector<double> speeds(stretch.size());
  std::size_t first = 0, last = 0;
  for (std::size_t i = 0; i < stretch.size(); ++i) {
    const double now = stretch[i].time_s;
    while (stretch[first].time_s < now - kSmoothingS / 2) ++first;
    while (last + 1 < stretch.size() && stretch[last + 1].time_s <= now + kSmoothingS / 2) ++last;
    const double span = stretch[last].time_s - stretch[first].time_s;
    if (span > 0) speeds[i] = length(stretch[last].tip_m - stretch[first].tip_m) / span;
  }
  return speeds;
}

// Calls visit(first, end) for each run of samples whose speed satisfies `holds`, long enough.
template <typename Holds, typename Visit>
void for_each_run(const std::vector<Sample>& stretch, const std::vector<double>& speeds,
                  Holds holds, Visit visit) {
  for (std::size_t i = 0; i < speeds.size();) {
    if (!holds(speeds[i])) {
      ++i;
      continue;
    }
    std::size_t end = i;
    while (end < speeds.size() && holds(speeds[end])) ++end;
    if (stretch[end - 1].time_s - stretch[i].time_s >= kRestS) visit(i, end);
    i = end;
  }
}

struct Sums {
  double seconds = 0, touched_s = 0, touched_ns = 0, straight_m = 0;
  std::vector<double> arcs;
};

void add_stretch(const std::vector<Sample>& stretch, double limit_n, Skill& skill, Sums& sums) {
  if (stretch.size() < 2) return;
  const auto speeds = speeds_of(stretch);
  for (std::size_t i = 1; i < stretch.size(); ++i) {
    const auto& [time, tip, force] = stretch[i];
    const double dt = time - stretch[i - 1].time_s, newton = length(force);
    const auto way = tip - stretch[i - 1].tip_m;
    skill.seconds += dt;
    skill.path_m += length(way);
    skill.peak_n = std::max(skill.peak_n, newton);
    if (newton > kTouchN) sums.touched_s += dt, sums.touched_ns += newton * dt;
    if (newton > limit_n) skill.above_limit_s += dt;
    if (newton <= kTouchN && speeds[i] < kStillM_s) skill.idle_s += dt;
    skill.work_j += std::max(0.0, -dot((force + stretch[i - 1].force_n) / 2, way));
  }
  // Way between rests: the stretch's ends count as rests.
  std::vector<Vec3d> rests{stretch.front().tip_m};
  for_each_run(
      stretch, speeds, [](double v) { return v < kStillM_s; },
      [&](std::size_t first, std::size_t end) {
        rests.push_back(stretch[(first + end) / 2].tip_m);
      });
  rests.push_back(stretch.back().tip_m);
  for (std::size_t i = 1; i < rests.size(); ++i) sums.straight_m += length(rests[i] - rests[i - 1]);
  const double rate =
      static_cast<double>(stretch.size() - 1) / (stretch.back().time_s - stretch.front().time_s);
  for_each_run(
      stretch, speeds, [](double v) { return v > kMovementM_s; },
      [&](std::size_t first, std::size_t end) {
        const auto at = [&](std::size_t i) {
          return speeds.begin() + static_cast<std::ptrdiff_t>(i);
        };
        sums.arcs.push_back(spectral_arc_length({at(first), at(end)}, rate));
      });
}

double ellipsoid_volume(const std::vector<Sample>& samples) {
  Vec3d mean;
  for (const auto& sample : samples) mean += sample.tip_m / static_cast<double>(samples.size());
  SymMat3<double> c;
  for (const auto& sample : samples)
    c.add_outer(sample.tip_m - mean, 1.0 / static_cast<double>(samples.size()));
  const double determinant = c.xx * (c.yy * c.zz - c.yz * c.yz) -
                             c.xy * (c.xy * c.zz - c.yz * c.xz) +
                             c.xz * (c.xy * c.yz - c.yy * c.xz);
  return 4.0 / 3 * std::numbers::pi * 8 * std::sqrt(std::max(0.0, determinant));
}

}  // namespace

double spectral_arc_length(const std::vector<double>& speeds, double rate_hz) {
  // Zeros behind the profile make the spectrum fine: 16 times the next power of two.
  std::size_t length = 1;
  while (length < speeds.size()) length *= 2;
  length *= 16;
  const double step_hz = rate_hz / static_cast<double>(length);
  const auto bins = static_cast<std::size_t>(std::min(kCutOffHz, rate_hz / 2) / step_hz) + 1;
  std::vector<double> amplitudes(bins);
  for (std::size_t k = 0; k < bins; ++k) {
    const double turn = 2 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(length);
    const std::complex<double> step = std::polar(1.0, turn);
    std::complex<double> sum = 0, wave = 1;
    for (const double speed : speeds) sum += speed * wave, wave *= step;
    amplitudes[k] = std::abs(sum);
  }
  const double most = *std::ranges::max_element(amplitudes);
  if (!(most > 0)) return 0;
  std::size_t last = bins;
  while (last > 1 && amplitudes[last - 1] / most < kLeastAmplitude) --last;
  if (last < 2) return 0;
  const double df = 1.0 / static_cast<double>(last - 1);
  double arc = 0;
  for (std::size_t k = 1; k < last; ++k)
    arc -= std::hypot(df, (amplitudes[k] - amplitudes[k - 1]) / most);
  return arc;
}

Skill measure_skill(const Track& track, double limit_n) {
  Skill skill;
  if (track.samples.empty()) return skill;
  Sums sums;
  std::vector<Sample> stretch;
  for (const auto& sample : track.samples) {
    if (!stretch.empty() && sample.time_s - stretch.back().time_s > kGapS) {
      add_stretch(stretch, limit_n, skill, sums);
      stretch.clear();
    }
    stretch.push_back(sample);
  }
  add_stretch(stretch, limit_n, skill, sums);
  if (skill.path_m > 0) skill.economy = std::min(1.0, sums.straight_m / skill.path_m);
  if (sums.touched_s > 0) skill.mean_n = sums.touched_ns / sums.touched_s;
  skill.working_volume_m3 = ellipsoid_volume(track.samples);
  skill.movements = static_cast<int>(sums.arcs.size());
  if (!sums.arcs.empty()) {
    const auto middle = sums.arcs.begin() + static_cast<std::ptrdiff_t>(sums.arcs.size() / 2);
    std::ranges::nth_element(sums.arcs, middle);
    skill.smoothness = *middle;
  }
  return skill;
}

}  // namespace trocar::lesson
