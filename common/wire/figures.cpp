#include "common/wire/figures.h"

#include <algorithm>

namespace trocar::wire {

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

std::string name_of(const PatchSet& patches) {
  std::string text = patches.count == 1 ? "patch " : "patches ";
  for (std::uint32_t i = 0; i < patches.count; ++i)
    text += (i > 0 ? " + " : "") + std::to_string(patches.patches[i] + 1);
  return text;
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

const char* name_of(RateLevel level) {
  switch (level) {
    case RateLevel::Fixed:
      return "fixed";
    case RateLevel::Full:
      return "full";
    case RateLevel::Reduced:
      return "reduced";
    case RateLevel::Overloaded:
      return "overloaded";
  }
  return "?";
}

const char* name_of(Stage stage) {
  switch (stage) {
    case Stage::Admit:
      return "admit";
    case Stage::Contacts:
      return "contacts";
    case Stage::Queue:
      return "queue";
    case Stage::Solve:
      return "solve";
    case Stage::Cut:
      return "cut";
    case Stage::Claims:
      return "claims";
    case Stage::Hash:
      return "hash";
    case Stage::Publish:
      return "publish";
  }
  return "?";
}

}  // namespace trocar::wire
