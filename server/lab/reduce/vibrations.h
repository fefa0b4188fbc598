#pragma once

// The slowest vibrations of an organ at rest, as whole: K x = omega^2 M x. Fields of forces at rest
// do not have what inertia does to the organ far from them; a few of these do.

#include <vector>

#include "server/lab/reduce/full_model.h"

namespace trocar::reduce {

struct Vibrations {
  Matrix modes;                 // 3 per node, a column each, x^T M x = 1, slowest first
  std::vector<double> rates_s;  // omega, 1/s
};
// By iteration of a subspace: `count` modes, at most as many as there are nodes that are not held,
// the same for every run. Rates within some 1e-3.
Vibrations slowest_vibrations(FullModel& model, std::size_t count);

}  // namespace trocar::reduce
