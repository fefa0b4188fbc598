#pragma once

// Organs that no constant of the solver was chosen on, each with a round tip that presses it.

#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/organs/organ/organ.h"

namespace trocar::calibration::testing {

struct ForceOrgan {
  std::string name;
  std::string shared_file;  // in the folder of shared meshes; empty: it is generated
  std::function<Result<organ::Organ>()> make;
  std::vector<int> missed_at_mm_s = {};  // presses of which the target is known to be missed
};
inline void PrintTo(const ForceOrgan& organ, std::ostream* out) {
  *out << organ.name;
}

// Livers of several sizes and stiffnesses, walls, slabs and shells drawn by seeds.
std::vector<ForceOrgan> force_organs();

}  // namespace trocar::calibration::testing
