#include "tests/validation/measure.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace trocar::validation {

Field field_of(const scenario::ScenarioRun& run) {
  Field field;
  field.reserve(run.world().node_count());
  for (const auto& u : run.world().displacements) field.push_back(to_double(u));
  return field;
}

double field_error(const Field& a, const Field& b) {
  double difference = 0, reference = 0;
  for (std::size_t i = 0; i < b.size(); ++i) {
    difference += length_squared(a[i] - b[i]);
    reference += length_squared(b[i]);
  }
  return std::sqrt(difference / reference);
}

double largest(const Field& field) {
  double most = 0;
  for (const auto& u : field) most = std::max(most, length(u));
  return most;
}

double largest_difference(const Field& a, const Field& b) {
  double most = 0;
  for (std::size_t i = 0; i < b.size(); ++i) most = std::max(most, length(a[i] - b[i]));
  return most;
}

double loop_area(std::span<const double> displacement_m, std::span<const double> force_n) {
  double area = 0;
  for (std::size_t i = 1; i < displacement_m.size(); ++i)
    area += 0.5 * (force_n[i] + force_n[i - 1]) * (displacement_m[i] - displacement_m[i - 1]);
  return area;
}

plot::Series force_curve(const std::string& name, std::span<const Vec3d> forces_n,
                         plot::Style style) {
  plot::Series series{name, {}, {}, style, {}};
  for (std::size_t i = 0; i < forces_n.size(); i += 4) {
    series.x.push_back(static_cast<double>(i + 1) * 1e-3);
    series.y.push_back(length(forces_n[i]));
  }
  return series;
}

NodeIndex node_nearest(const organ::Organ& organ, const Vec3d& point_m) {
  NodeIndex best;
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto node : organ.mesh.surface_nodes) {
    const double d = length_squared(organ.mesh.rest_positions[node.value] - point_m);
    if (d >= nearest) continue;
    nearest = d;
    best = node;
  }
  return best;
}

}  // namespace trocar::validation
