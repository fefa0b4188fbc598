#pragma once

// A measured force-displacement curve from a CSV file: a header that names the columns
// displacement_mm and force_n, and time_s if the order in time matters; other columns do not count,
// nor do empty lines and lines that begin with #. Displacement and force are positive along the
// load.

#include <filesystem>
#include <vector>

#include "common/base/result.h"

namespace trocar::fit {

struct Measurement {
  double displacement_m = 0, force_n = 0;
  double time_s = 0;
  int line = 0;  // in the file
};

struct MeasuredCurve {
  std::filesystem::path source;
  bool has_times = false;           // then times increase
  std::vector<Measurement> points;  // at least one
};

Result<MeasuredCurve> read_measurements(const std::filesystem::path& path);

}  // namespace trocar::fit
