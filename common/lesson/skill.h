#pragma once

// Measures of how a hand moved and what it did to the tissue, from where its tip was and what force
// the tissue had on it, frame by frame. docs/lessons.md says where each comes from.

#include <optional>
#include <string>
#include <vector>

#include "common/math/vec3.h"

namespace trocar::lesson {

// One tool over time; evenly spaced but for gaps while it was away.
struct Track {
  struct Sample {
    double time_s = 0;
    Vec3d tip_m, force_n;  // of the tissue on the tool
  };
  std::vector<Sample> samples;
  int grasps = 0, cuts = 0;  // that were granted
  int refusals = 0;          // grasps and cuts that were refused
  int losses = 0;            // grasps out of which the tissue slipped
};

struct Skill {
  double seconds = 0;  // that it was there
  double idle_s = 0;   // slower than 5 mm/s and touching nothing
  double path_m = 0;
  double economy = 1;                // straight ways between its rests over the path, 0 to 1
  double working_volume_m3 = 0;      // of the ellipsoid of twice the standard deviations
  std::optional<double> smoothness;  // median spectral arc length of its movements, below 0
  int movements = 0;
  double peak_n = 0, mean_n = 0;  // mean: while it touches
  double above_limit_s = 0;
  double work_j = 0;  // that it did on the tissue, what came back left out
};
// `limit_n`: of above_limit_s.
Skill measure_skill(const Track& track, double limit_n);

// Spectral arc length of a speed profile (Balasubramanian, Melendez-Calderon, Roby-Brami and Burdet
// 2015): of its amplitude spectrum over the greatest one, up to 10 Hz and to where it stays below
// 0.05. Nearer to zero is smoother. `speeds`: at least two, one of them above zero.
double spectral_arc_length(const std::vector<double>& speeds, double rate_hz);

}  // namespace trocar::lesson
