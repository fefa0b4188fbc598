#pragma once

// The same problem in CalculiX (ccx), an independent solver: its input file, its run, and the
// displacements that it found. It has reduced polynomials up to N = 3 in the isochoric form with
// (J - 1)^2 / D1, so D1 = 2 / K; no relaxation.

#include <filesystem>

#include "server/lab/finite_elements/solver.h"
#include "tests/validation/measure.h"

namespace trocar::validation {

// Whether ccx is among the programs.
bool has_calculix();

// One static step to the loads, of a problem with one material of the isochoric form. Error: a law
// that CalculiX does not have.
Result<std::string> calculix_input(const finite_elements::Problem& problem,
                                   const finite_elements::Loads& loads);

// Runs it in the folder as <name>.inp; displacements of all nodes, middle ones too. Error: it ended
// without the last increment.
Result<Field> run_calculix(const std::filesystem::path& folder, const std::string& name,
                           const std::string& input, std::size_t node_count);

}  // namespace trocar::validation
