#pragma once

// A reference that is solved tick by tick has to pass these checks before anything is judged by it.

#include <string>

#include "server/lab/calibration/converged.h"
#include "tests/validation/report.h"

namespace trocar::validation {

// Two checks: that every tick reached its tolerance, and that a tolerance kLooser times larger
// changes the contact force by no more than the bound; own_error is this change.
void check_reference(Section& section, const std::string& name,
                     const calibration::Convergence& convergence, double own_error, Bound bound);

}  // namespace trocar::validation
