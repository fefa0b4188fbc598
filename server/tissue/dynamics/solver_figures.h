#pragma once

// These figures tell the people in a session which solver moved the tissue in a tick, and why.

#include <array>
#include <cstdint>
#include <span>

#include "common/base/tick.h"

namespace trocar::dynamics {

// Ascending numbers of the patches of a far-field model that act together.
struct PatchSet {
  static constexpr std::size_t kMaxPatches = 4;

  std::array<std::uint32_t, kMaxPatches> patches{};
  std::uint32_t count = 0;

  std::span<const std::uint32_t> all() const { return {patches.data(), count}; }
  bool has(std::uint32_t patch) const;
  // False: there is no room.
  bool add(std::uint32_t patch);
  bool operator==(const PatchSet&) const = default;
};

enum class SolverReason : std::uint8_t {
  None,       // the session has no model of its far field
  Idle,       // nothing has been touched yet
  Fits,       // a patch has what is touched
  Frozen,     // the tissue beyond the limits stands still
  Outside,    // touched where no patch is, or by tools that touch more patches than act together
  Force,      // a node bears more than the model knows
  Cut,        // tissue was cut just now, or is where it is touched
  Error,      // the estimate of the error is too large
  Off,        // it was decided so
  Preparing,  // patches that are touched together are being made ready to act together
};
inline constexpr std::uint8_t kSolverReasons = 10;
const char* name_of(SolverReason reason);

struct SolverFigures {
  bool is_reduced = false;
  SolverReason reason = SolverReason::None;
  PatchSet patches;    // while they act
  float estimate = 0;  // of the model's error, relative, of the tick before
  float largest_node_force_n = 0;
};

// The solver, its patches or the reason changed from the tick before to this one.
struct SolverChange {
  Tick tick = 0;
  SolverFigures figures;
};

}  // namespace trocar::dynamics
