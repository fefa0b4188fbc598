#include "server/tissue/dynamics/solver_figures.h"

#include <algorithm>

namespace trocar::dynamics {

bool PatchSet::has(std::uint32_t patch) const {
  return std::ranges::binary_search(all(), patch);
}
bool PatchSet::add(std::uint32_t patch) {
  if (has(patch)) return true;
  if (count == kMaxPatches) return false;
  patches[count++] = patch;
  std::sort(patches.begin(), patches.begin() + count);
  return true;
}

const char* name_of(SolverReason reason) {
  switch (reason) {
    case SolverReason::None:
      return "no reduction";
    case SolverReason::Idle:
      return "nothing touched yet";
    case SolverReason::Fits:
      return "contact within patches";
    case SolverReason::Frozen:
      return "tissue frozen beyond its limits";
    case SolverReason::Outside:
      return "contact not within patches";
    case SolverReason::Force:
      return "more force than trained";
    case SolverReason::Cut:
      return "tissue was cut";
    case SolverReason::Error:
      return "estimated error too large";
    case SolverReason::Off:
      return "switched off";
    case SolverReason::Preparing:
      return "patches are being made ready together";
  }
  return "?";
}

}  // namespace trocar::dynamics
