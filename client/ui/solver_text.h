#pragma once

// These texts say which solver moves the tissue, in words for somebody who learns to operate.
// Nothing is drawn here.

#include <string>

#include "client/replica/session_view.h"

namespace trocar::ui {

struct SolverText {
  std::string state;  // "reduced, patches 3 + 12", "full (tissue was cut)"
  std::string error;  // "7 % in energy", of which a force errs by less; empty: no patch acts
  bool is_reduced = false;
};
SolverText describe(const wire::SolverFigures& solver);
// Describes the full solution beside it: "at most 0.21 mm away, rms 0.03 mm", or why there is none.
std::string describe(const replica::Ghost& ghost, bool is_replay);

}  // namespace trocar::ui
