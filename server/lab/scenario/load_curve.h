#pragma once

// Force against displacement: what a testing machine draws, of whatever in a scenario loads the
// tissue in a direction and is probed. Three kinds:
//   - a displaced set whose reaction is probed;
//   - a tool whose force is probed; its displacement is that of its tip since the start;
//   - a loaded set whose displacement is probed.
// The direction is that of the largest displacement (or force) in the scenario; displacement and
// force are the parts along it, the force as it acts on the tissue. Any thread.

#include <string>
#include <vector>

#include "server/lab/scenario/scenario_run.h"

namespace trocar::scenario {

struct LoadCurve {
  enum class Kind : std::uint8_t { DisplacedSet, Tool, LoadedSet };

  std::string name;  // of the set, or "tool0"
  Kind kind = Kind::DisplacedSet;
  std::size_t load = 0;   // in displacements, tools or forces of the scenario
  std::size_t probe = 0;  // of the force, or of the displacement of a loaded set
  Vec3d direction;        // unit vector
};

struct LoadPoint {
  double displacement_m = 0, force_n = 0;
};

// Those of a scenario, in the order of its probes.
std::vector<LoadCurve> load_curves(const scenario::ResolvedScenario& resolved);
// After a step.
LoadPoint load_point(const ScenarioRun& run, const LoadCurve& curve);

}  // namespace trocar::scenario
