#pragma once

// A record keeps what happened in a closed loop, millisecond by millisecond; figures are measured
// of it.

#include <string>
#include <vector>

#include "common/math/vec3.h"

namespace trocar::haptics::testing {

// Surface coordinates: z out of the tissue.
struct Record {
  std::vector<Vec3d> tip_m, rendered_n, true_n;
  double cut_s = -1;  // tissue gave way then
};

// This is measured of a record.
struct Measured {
  double frequency_hz = 0;  // of a palpation, measured from 1.5 s before the end
  double steady_from_s = -1;
  double cut_n = 0;     // the force at which tissue gave way
  bool is_free = true;  // 2 mm and more above the surface no force is due
};

struct Outcome {
  double rms = 0;                      // error over the peak of the truth
  double greatest = 0;                 // likewise
  double step_n = 0, true_step_n = 0;  // greatest change in a millisecond
  double gain = 1, phase_deg = 0;
  double steady = 0;                       // error over the truth
  double work_mj = 0;                      // the most done on the hand since the start
  double cycle_mj = 0, true_cycle_mj = 0;  // done on the hand in a cycle
  double wobble_m = 0;
  double free_n = 0;       // greatest force where none is due
  double recovery_s = -1;  // from a cut until the force is right within 15 %
  double peak_n = 0;
};

Outcome measure(const Measured& measured, const Record& record);

}  // namespace trocar::haptics::testing
