#pragma once

// Force to depth (Choi 2002 sec. 3): how much of an organ a contact of a given force must move, for
// the force to be that of the full solution but for a chosen error. Measured by trocar-organ
// calibrate, kept in the organ's file, looked up between ticks (server/session/control). It changes
// no result by itself: what was decided with it is an input of a tick.
//
// Invariants (validate): rows ascend in force; a limit holds for all forces above the row before,
// up to its own; beyond the last row nothing is known. Immutable, any thread.

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/base/result.h"

namespace trocar::organ {

struct DepthRow {
  double force_n = 0;  // of one contact, up to this
  // Boundary::Frozen: nodes in the queue; none: no limit below the whole organ suffices.
  std::optional<std::uint32_t> frozen_nodes;
  // Boundary::Graded: layers around the contact that get all sweeps; none: none of those tried.
  std::optional<std::uint32_t> graded_depth;
  // Largest found at these, or where there is none at the most that was tried; shares of the force.
  double frozen_error = 0, graded_error = 0;

  bool operator==(const DepthRow&) const = default;
};

struct DepthTable {
  double error = 0;          // that was asked for, a share of the force
  double tool_radius_m = 0;  // of the round tip that pressed
  std::uint32_t places = 0;  // of the surface that were pressed
  std::vector<DepthRow> rows;

  bool empty() const { return rows.empty(); }
  bool operator==(const DepthTable&) const = default;
};

// Both take the forces of all contacts of a tick. Frozen nodes are the sum of what each contact
// needs, the graded depth is the deepest. The result is nothing if there is no contact, or for one
// of them nothing is known or suffices.
std::optional<std::uint32_t> frozen_nodes_for(const DepthTable& table,
                                              std::span<const double> forces_n);
std::optional<std::uint32_t> graded_depth_for(const DepthTable& table,
                                              std::span<const double> forces_n);

inline constexpr std::size_t kMaxDepthRows = 1000;

Status validate(const DepthTable& table);

}  // namespace trocar::organ
