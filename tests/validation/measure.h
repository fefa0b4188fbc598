#pragma once

// These functions read off a run what experiments compare.

#include <span>
#include <vector>

#include "common/plot/plot.h"
#include "server/lab/scenario/scenario_run.h"

namespace trocar::validation {

// Displacements of all nodes, m.
using Field = std::vector<Vec3d>;
Field field_of(const scenario::ScenarioRun& run);

// |a - b| / |b| over all nodes (root of the sums of squares).
double field_error(const Field& a, const Field& b);
double largest(const Field& field);
double largest_difference(const Field& a, const Field& b);

// Work done along a closed curve of displacement and force by the trapezoidal rule, J.
double loop_area(std::span<const double> displacement_m, std::span<const double> force_n);

// Lengths of forces over time, from one force per tick, every fourth.
plot::Series force_curve(const std::string& name, std::span<const Vec3d> forces_n,
                         plot::Style style);

// The surface node at rest nearest to a point (all nodes if the organ has no such).
NodeIndex node_nearest(const organ::Organ& organ, const Vec3d& point_m);

}  // namespace trocar::validation
