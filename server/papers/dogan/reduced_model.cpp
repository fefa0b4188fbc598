#include "server/papers/dogan/reduced_model.h"

#include <algorithm>

namespace trocar::dogan {

Matrix square(const std::vector<double>& numbers, std::size_t size) {
  const auto n = static_cast<Eigen::Index>(size);
  TROCAR_ASSERT(numbers.size() == size * size);
  return Eigen::Map<const Matrix>(numbers.data(), n, n);
}

ReducedModel::ReducedModel(const Reduction& reduction, TangentChoice tangent,
                           std::size_t mode_count) {
  const auto all = reduction.mode_count();
  TROCAR_ASSERT(mode_count <= all);
  const auto count = static_cast<Eigen::Index>(mode_count == 0 ? all : mode_count);
  const auto& numbers = tangent == TangentChoice::Initial ? reduction.initial_tangent_n_m
                                                          : reduction.best_tangent_n_m;
  modes_ = Eigen::Map<const Matrix>(reduction.modes.data(),
                                    3 * static_cast<Eigen::Index>(reduction.node_count),
                                    static_cast<Eigen::Index>(all))
               .leftCols(count);
  // Modes are nested, and so are their tangents.
  factors_.compute(square(numbers, all).topLeftCorner(count, count));
  TROCAR_ASSERT(factors_.info() == Eigen::Success);
}

Vector ReducedModel::solve(std::span<const NodeForce> forces) const {
  Vector reduced = Vector::Zero(modes_.cols());
  for (const auto& [node, force] : forces)
    reduced += modes_.middleRows<3>(3 * static_cast<Eigen::Index>(node.value)).transpose() *
               Eigen::Vector3d(force.x, force.y, force.z);
  return factors_.solve(reduced);
}

Vec3d ReducedModel::displacement(const Vector& xi, NodeIndex node) const {
  const Eigen::Vector3d u = modes_.middleRows<3>(3 * static_cast<Eigen::Index>(node.value)) * xi;
  return {u[0], u[1], u[2]};
}

const CreepCurve& CreepFactors::curve_near(NodeIndex loaded) const {
  const auto& rest = organ_.mesh.rest_positions;
  return *std::ranges::min_element(reduction_.creep, {}, [&](const CreepCurve& curve) {
    return length_squared(rest[curve.node.value] - rest[loaded.value]);
  });
}

double CreepFactors::at(const std::vector<double>& growth, double time_s) const {
  const auto& times = reduction_.creep_times_s;
  if (time_s <= 0) return growth.front();
  const auto after = std::ranges::upper_bound(times, time_s);
  if (after == times.end()) return growth.back();
  const auto i = static_cast<std::size_t>(after - times.begin());
  const double part = (time_s - times[i - 1]) / (times[i] - times[i - 1]);
  return growth[i - 1] + part * (growth[i] - growth[i - 1]);
}

double CreepFactors::growth(NodeIndex loaded, NodeIndex node, double time_s) const {
  if (empty()) return 1;
  const auto& curve = curve_near(loaded);
  const auto found = std::ranges::lower_bound(curve.neighbours, node, {}, &CreepNeighbour::node);
  const bool is_near = found != curve.neighbours.end() && found->node == node;
  return at(is_near ? found->growth : curve.overall_growth, time_s);
}

void CreepFactors::scale(NodeIndex loaded, double time_s, Vector& displacements) const {
  if (empty()) return;
  const auto& curve = curve_near(loaded);
  const double overall = at(curve.overall_growth, time_s);
  Vector factors = Vector::Constant(displacements.size(), overall);
  for (const auto& [node, growth] : curve.neighbours)
    factors.segment<3>(3 * static_cast<Eigen::Index>(node.value)).setConstant(at(growth, time_s));
  displacements.array() *= factors.array();
}

}  // namespace trocar::dogan
