#include "client/ui/solver_text.h"

#include <cstdio>

namespace trocar::ui {
namespace {

const char* words_of(wire::SolverReason reason) {
  switch (reason) {
    case wire::SolverReason::None:
      return "";
    case wire::SolverReason::Idle:
      return "nothing touched yet";
    case wire::SolverReason::Fits:
      return "within a patch";
    case wire::SolverReason::Frozen:
      return "far tissue is frozen";
    case wire::SolverReason::Outside:
      return "not within patches";
    case wire::SolverReason::Force:
      return "more force than trained";
    case wire::SolverReason::Cut:
      return "tissue was cut";
    case wire::SolverReason::Error:
      return "error too large";
    case wire::SolverReason::Off:
      return "switched off";
    case wire::SolverReason::Preparing:
      return "patches are being made ready";
  }
  return "";
}

std::string error_text(float estimate) {
  const double percent = 100 * static_cast<double>(estimate);
  if (percent >= 100) return "over 100 % in energy";
  char text[40];
  if (percent < 0.1) return "below 0.1 % in energy";
  std::snprintf(text, sizeof text, percent < 9.95 ? "%.1f %% in energy" : "%.0f %% in energy",
                percent);
  return text;
}

}  // namespace

SolverText describe(const wire::SolverFigures& solver) {
  SolverText text;
  text.is_reduced = solver.is_reduced;
  if (solver.is_reduced) {
    text.state = "reduced, " + wire::name_of(solver.patches);
    text.error = error_text(solver.estimate);
    return text;
  }
  text.state = "full";
  const std::string why = words_of(solver.reason);
  if (!why.empty()) text.state += " (" + why + ")";
  return text;
}

std::string describe(const replica::Ghost& ghost, bool is_replay) {
  if (is_replay) return "none: recordings have no ghost";
  switch (ghost.status) {
    case replica::GhostStatus::Unknown:
      return "asked for";
    case replica::GhostStatus::None:
      return "none: this session has no reduction";
    case replica::GhostStatus::Begins:
      return "begins";
    case replica::GhostStatus::Changed:
      return "begins again after the change";
    case replica::GhostStatus::Behind:
      return "too slow, begins again";
    case replica::GhostStatus::Follows:
      break;
  }
  if (ghost.offsets.empty()) return "waits for the surface";
  char text[80];
  const auto mm = [](float m) { return 1e3 * static_cast<double>(m); };
  std::snprintf(text, sizeof text, "at most %.2f mm away, rms %.2f mm", mm(ghost.largest_m),
                mm(ghost.root_mean_square_m));
  std::string line = text;
  // Less is hard to see.
  if (ghost.behind_ms >= 200) {
    std::snprintf(text, sizeof text, "; %.1f s behind", 1e-3 * ghost.behind_ms);
    line += text;
  }
  return line;
}

}  // namespace trocar::ui
