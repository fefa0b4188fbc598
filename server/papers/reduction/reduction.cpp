#include "server/papers/reduction/reduction.h"

#include <algorithm>
#include <cmath>

#include "common/math/cholesky.h"
#include "server/organs/organ/bad_file.h"

namespace trocar::reduction {
namespace {

constexpr double kSymmetry = 1e-9;
// Tissue may grow by this factor, which is beyond what any relaxation here can give.
constexpr double kMaxGrowth = 1e4;

using organ::bad;

bool are_finite(const std::vector<double>& values) {
  return std::ranges::all_of(values, [](double v) { return std::isfinite(v); });
}

bool is_stiffness(const std::vector<double>& matrix, std::size_t n) {
  std::vector<double> lower;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j <= i; ++j) {
      if (std::abs(matrix[i * n + j] - matrix[j * n + i]) >
          kSymmetry * std::sqrt(std::abs(matrix[i * n + i] * matrix[j * n + j])))
        return false;
      lower.push_back(matrix[i * n + j]);
    }
  return is_positive_definite(lower, n);
}

Status check_modes(const Reduction& r) {
  const std::size_t length = 3 * std::size_t{r.node_count};
  for (std::size_t a = 0; a < r.mode_count(); ++a)
    for (std::size_t b = 0; b <= a; ++b) {
      double product = 0;
      for (std::size_t i = 0; i < length; ++i)
        product += r.modes[a * length + i] * r.modes[b * length + i];
      if (std::abs(product - (a == b ? 1 : 0)) > kOrthonormality)
        return bad("modes " + std::to_string(b + 1) + " and " + std::to_string(a + 1) +
                   " are not orthonormal, their product is " + std::to_string(product));
    }
  return {};
}

bool is_growth(const std::vector<double>& growth, std::size_t times) {
  return growth.size() == times && growth.front() == 1 &&
         std::ranges::all_of(growth, [](double g) { return std::abs(g) <= kMaxGrowth; });
}

Status check_creep(const Reduction& r) {
  const auto& times = r.creep_times_s;
  if (times.empty() != r.creep.empty())
    return bad("has times of creep without curves, or curves without times");
  if (times.empty()) return {};
  if (times.size() < 2 || times.size() > kMaxCreepTimes || r.creep.size() > kMaxCreepCurves)
    return bad("has " + std::to_string(times.size()) + " times and " +
               std::to_string(r.creep.size()) + " curves of creep, must have 2 to " +
               std::to_string(kMaxCreepTimes) + " and at most " + std::to_string(kMaxCreepCurves));
  if (times.front() != 0 ||
      std::ranges::adjacent_find(times, std::greater_equal<>()) != times.end())
    return bad("times of creep are not ascending from 0");
  for (const auto& curve : r.creep) {
    const auto name = "creep around node " + std::to_string(curve.node.value);
    if (curve.node.value >= r.node_count || !is_growth(curve.overall_growth, times.size()))
      return bad(name + " is of a node that is not there, or has growths out of range");
    for (std::size_t i = 0; i < curve.neighbours.size(); ++i) {
      const auto& [node, growth] = curve.neighbours[i];
      if (node.value >= r.node_count || !is_growth(growth, times.size()) ||
          (i > 0 && curve.neighbours[i - 1].node >= node))
        return bad(name +
                   " has neighbours that are not there or not ascending, or growths out of range");
    }
  }
  return {};
}

}  // namespace

Status validate(const Reduction& r) {
  const std::size_t modes = r.mode_count();
  if (r.method != "dogan") return bad("is of an unknown method, must be dogan");
  if (modes == 0 || modes > kMaxReducedModes)
    return bad("has " + std::to_string(modes) + " modes, must have 1 to " +
               std::to_string(kMaxReducedModes));
  if (r.node_count == 0 || r.modes.size() != 3 * std::size_t{r.node_count} * modes)
    return bad("has " + std::to_string(r.modes.size()) + " numbers in its modes, must have 3 x " +
               std::to_string(r.node_count) + " nodes x " + std::to_string(modes) + " modes");
  if (r.initial_tangent_n_m.size() != modes * modes || r.best_tangent_n_m.size() != modes * modes)
    return bad("its tangents are not of " + std::to_string(modes) + " x " + std::to_string(modes) +
               " numbers");
  for (const auto* values :
       {&r.eigenvalues_m2, &r.modes, &r.initial_tangent_n_m, &r.best_tangent_n_m, &r.creep_times_s})
    if (!are_finite(*values)) return bad("has numbers that are not finite");
  for (const double value : {r.eigenvalue_sum_m2, r.force_n, r.radius_m, r.influence_m})
    if (!std::isfinite(value) || value < 0)
      return bad("its sum of eigenvalues, force or radii are not finite and from 0 up");
  if (r.eigenvalues_m2.back() < 0 || !std::ranges::is_sorted(r.eigenvalues_m2, std::greater<>()))
    return bad("eigenvalues are not descending down to 0");
  if (auto s = check_modes(r); !s) return s;
  if (!is_stiffness(r.initial_tangent_n_m, modes) || !is_stiffness(r.best_tangent_n_m, modes))
    return bad("its tangents are not symmetric and positive definite");
  return check_creep(r);
}

Status check_organ(const Reduction& r, const organ::Organ& organ) {
  if (r.node_count != organ.mesh.node_count())
    return bad("is of another mesh: it has " + std::to_string(r.node_count) + " nodes, " +
               organ.name + " has " + std::to_string(organ.mesh.node_count()) +
               ": make it again with trocar-organ reduce");
  if (r.mesh_hash != mesh_hash(organ))
    return bad("is of another mesh than " + organ.name +
               ", or one that is held elsewhere: make it again with trocar-organ reduce");
  if (r.elasticity_hash != elasticity_hash(organ))
    return bad("is of another material than that of " + organ.name +
               ": make it again with trocar-organ reduce");
  return {};
}

}  // namespace trocar::reduction
