#include "server/papers/dogan/quality.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace trocar::dogan {

namespace {

constexpr double kTestSlant = 20 * std::numbers::pi / 180;
constexpr std::array kShares{0.3, 0.85};
// The first unseen press has this number among all: its azimuths are between those of the training.
constexpr std::size_t kFirst = 1001;

Eigen::Vector3d moved_by(const Vector& all, NodeIndex node) {
  return all.segment<3>(3 * static_cast<Eigen::Index>(node.value));
}

Matrix modes_of(const Reduction& r, std::size_t count) {
  return Eigen::Map<const Matrix>(r.modes.data(), 3 * static_cast<Eigen::Index>(r.node_count),
                                  static_cast<Eigen::Index>(count));
}

Quality::OfTangent measure(const ReducedModel& reduced, const organ::Organ& organ,
                           std::span<const Unseen> loads) {
  Quality::OfTangent result;
  for (const auto& [press, full] : loads) {
    const Vector u = reduced.displacements(reduced.solve(node_forces(organ, press)));
    const auto there = moved_by(full, press.node);
    result.field_errors.push_back((u - full).norm() / full.norm());
    result.contact_errors.push_back((moved_by(u, press.node) - there).norm() / there.norm());
    result.contact_ratio +=
        moved_by(u, press.node).norm() / there.norm() / static_cast<double>(loads.size());
  }
  result.field = errors_of(result.field_errors);
  result.contact = errors_of(result.contact_errors);
  return result;
}

}  // namespace

UnseenLoads solve_unseen(FullModel& model, const Training& training, const Settings& settings,
                         std::size_t places, const Progress& progress) {
  const auto& organ = model.organ();
  const auto normals = mesh::surface_normals(organ.mesh);
  UnseenLoads unseen;
  const auto nodes = spread_nodes(organ, accessible_nodes(organ, settings.radius_m), places,
                                  settings.seed, training.places);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    // The second of two is aslant.
    const Vec3d direction =
        press_directions(normals[nodes[i].value], kFirst + i, 2, kTestSlant).back();
    const Press press{nodes[i], direction * settings.force_n, settings.radius_m};
    auto found = model.displacements(model.forces_of(press), kShares);
    unseen.failed += kShares.size() - found.size();
    for (std::size_t k = 0; k < found.size(); ++k)
      unseen.loads.push_back(
          {{press.node, press.force_n * kShares[k], press.radius_m}, std::move(found[k])});
    if (progress) progress(Stage::Check, i + 1, nodes.size());
  }
  return unseen;
}

Quality quality_of(const Reduction& reduction, const organ::Organ& organ,
                   std::span<const Unseen> loads, std::size_t modes) {
  Quality quality;
  quality.modes = modes == 0 ? reduction.mode_count() : modes;
  const Matrix b = modes_of(reduction, quality.modes);
  std::vector<double> projections;
  for (const auto& load : loads) {
    const double norm = load.displacements.squaredNorm();
    const double shown = (b.transpose() * load.displacements).squaredNorm();
    projections.push_back(std::sqrt(std::max(0.0, norm - shown) / norm));
  }
  quality.projection = errors_of(projections);
  quality.initial =
      measure(ReducedModel(reduction, TangentChoice::Initial, quality.modes), organ, loads);
  quality.best = measure(ReducedModel(reduction, TangentChoice::Best, quality.modes), organ, loads);
  return quality;
}

std::optional<CreepCheck> check_creep(FullModel& model, const Reduction& reduction,
                                      const Press& press) {
  CreepCheck check{press, reduction.creep_times_s, {}, {}, {}, {}};
  const auto fields = model.creep(model.forces_of(press), check.times_s);
  if (fields.empty() || fields.size() != check.times_s.size()) return std::nullopt;
  const ReducedModel reduced(reduction, TangentChoice::Best);
  const CreepFactors factors(reduction, model.organ());
  const Vector at_once = reduced.displacements(reduced.solve(node_forces(model.organ(), press)));
  for (std::size_t i = 0; i < fields.size(); ++i) {
    Vector u = at_once, scaled = fields[0];
    factors.scale(press.node, check.times_s[i], u);
    factors.scale(press.node, check.times_s[i], scaled);
    check.full_m.push_back(moved_by(fields[i], press.node).norm());
    check.reduced_m.push_back(moved_by(u, press.node).norm());
    check.field_errors.push_back((u - fields[i]).norm() / fields[i].norm());
    check.scaling_errors.push_back((scaled - fields[i]).norm() / fields[i].norm());
  }
  return check;
}

}  // namespace trocar::dogan
