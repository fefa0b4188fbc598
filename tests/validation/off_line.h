#pragma once

// Scenario texts on the off-line finite-element solver, which shares no element with the live one.

#include <memory>
#include <string>

#include "server/lab/finite_elements/scenario_solve.h"
#include "tests/validation/lab.h"

namespace trocar::validation {

// Solves to the end; null where no equilibrium was found. A text that cannot run is an error of
// this program.
std::unique_ptr<finite_elements::ScenarioSolve> solve_off_line(const Lab& lab,
                                                               const std::string& text,
                                                               finite_elements::ElementOrder order);

// The first probe at the end; NaN where no equilibrium was found.
Vec3d probe_off_line(const Lab& lab, const std::string& text, finite_elements::ElementOrder order);

}  // namespace trocar::validation
