#pragma once

// Which solver moves the tissue, in words for somebody who learns to operate. No drawing here.

#include <string>

#include "client/replica/session_view.h"

namespace trocar::ui {

struct SolverText {
  std::string state;  // "reduced, patches 3 + 12", "full (tissue was cut)"
  // "0.3 % of the force", from the square of the estimate; empty: no patch acts.
  std::string error;
  bool is_reduced = false;
};
SolverText describe(const replica::SolverFigures& solver);

}  // namespace trocar::ui
