#include "server/lab/reduce/local_quality.h"

#include <algorithm>
#include <array>
#include <numbers>

#include "common/base/timing.h"

namespace trocar::reduce {
namespace {

constexpr double kTestSlant = 25 * std::numbers::pi / 180;
constexpr std::array kTestShares{0.3, 0.85};
// The first press here has this number among all, so that azimuths are not those of the training.
constexpr std::size_t kFirst = 1001;
constexpr double kHold_n_m = 1e4;  // some hundred times as stiff as tissue
constexpr int kRateSteps = 100;
constexpr std::array kPairSteps{0.5, 1.0};

Vec3d at(const Vector& field, NodeIndex node) {
  const auto i = 3 * static_cast<Eigen::Index>(node.value);
  return {field[i], field[i + 1], field[i + 2]};
}

double field_error(std::span<const Vec3d> moves, const Vector& full) {
  double wrong = 0;
  for (std::uint32_t n = 0; n < moves.size(); ++n)
    wrong += length_squared(moves[n] - at(full, NodeIndex(n)));
  return std::sqrt(wrong) / full.norm();
}

std::vector<NodeIndex> unseen_nodes(const organ::Organ& organ, const LocalBuilt& built) {
  const auto& x = organ.mesh.rest_positions;
  std::vector<NodeIndex> nodes;
  for (const auto& patch : built.reduction.patches)
    for (const auto node : patch.members)
      if (std::ranges::none_of(built.pressed, [&](NodeIndex pressed) {
            return length(x[pressed.value] - x[node.value]) < kFarFromTraining_m;
          }))
        nodes.push_back(node);
  return nodes;
}

}  // namespace

std::vector<LocalLoad> solve_local_loads(
    FullModel& model, const LocalBuilt& built, std::size_t trained_places,
    std::size_t unseen_places, const std::function<void(std::size_t, std::size_t)>& progress) {
  const auto& organ = model.organ();
  const auto normals = mesh::surface_normals(organ.mesh);
  std::vector<std::pair<NodeIndex, bool>> places;
  for (const auto node : spread_nodes(organ, built.pressed, trained_places, 0))
    places.push_back({node, true});
  for (const auto node : spread_nodes(organ, unseen_nodes(organ, built), unseen_places, 0))
    places.push_back({node, false});
  std::vector<LocalLoad> loads;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto [node, is_trained] = places[i];
    // Every other one is aslant.
    const auto directions = press_directions(normals[node.value], kFirst + i, 2, kTestSlant);
    const Vec3d force = directions[i % 2] * built.reduction.force_n;
    auto found = model.displacements(model.forces_of({node, force}), kTestShares);
    for (std::size_t k = 0; k < found.size(); ++k)
      loads.push_back({{node, force * kTestShares[k]}, is_trained, std::move(found[k])});
    if (progress) progress(i + 1, places.size());
  }
  return loads;
}

LocalErrors errors_of_local(const organ::LocalReduction& reduction, const organ::Organ& organ,
                            std::span<const LocalLoad> loads, bool trained) {
  LocalErrors errors;
  LocalSolver solver(reduction, organ);
  for (const auto& [press, is_trained, full] : loads) {
    if (is_trained != trained) continue;
    const std::array touched{press.node};
    if (!solver.touch(touched) ||
        !solver.solve(std::array{NodeForce{press.node, press.force_n}}).is_converged) {
      ++errors.unsolved;
      continue;
    }
    if (solver.sizes().unknowns() > errors.largest.unknowns()) errors.largest = solver.sizes();
    const auto moves = solver.displacements();
    errors.field.push_back(field_error(moves, full));
    const Vec3d there = at(full, press.node);
    errors.contact.push_back(length(moves[press.node.value] - there) / length(there));
    const NodeSpring hold{press.node, there, kHold_n_m};
    if (!solver.solve({}, std::array{hold}).is_converged) {
      ++errors.unsolved;
      continue;
    }
    const Vec3d force = (there - solver.displacement(press.node)) * kHold_n_m;
    errors.force.push_back(length(force - press.force_n) / length(press.force_n));
  }
  return errors;
}

LocalErrors errors_of_pairs(FullModel& model, const organ::LocalReduction& reduction,
                            std::span<const LocalLoad> loads, std::size_t pairs) {
  std::vector<const Press*> presses;
  for (const auto& load : loads)
    if (presses.empty() || presses.back()->node != load.press.node)
      presses.push_back(&load.press);
    else
      presses.back() = &load.press;
  LocalErrors errors;
  LocalSolver solver(reduction, model.organ());
  for (std::size_t i = 0; i + 1 < presses.size() && i < pairs; ++i) {
    const Press &a = *presses[i], &b = *presses[i + 1];
    const Vector forces = model.forces_of(a) + model.forces_of(b);
    const auto found = model.displacements(forces, kPairSteps);
    if (found.size() != kPairSteps.size()) continue;
    const auto& full = found.back();
    const std::array touched{a.node, b.node};
    const std::array pushes{NodeForce{a.node, a.force_n}, NodeForce{b.node, b.force_n}};
    if (!solver.touch(touched) || !solver.solve(pushes).is_converged) {
      ++errors.unsolved;
      continue;
    }
    if (solver.sizes().unknowns() > errors.largest.unknowns()) errors.largest = solver.sizes();
    const auto moves = solver.displacements();
    errors.field.push_back(field_error(moves, full));
    double contact = 0;
    for (const auto node : touched)
      contact += length(moves[node.value] - at(full, node)) / length(at(full, node)) / 2;
    errors.contact.push_back(contact);
  }
  return errors;
}

LocalRate rate_of_local(const organ::LocalReduction& reduction, const organ::Organ& organ,
                        const Press& press) {
  LocalRate rate;
  LocalSolver solver(reduction, organ);
  const std::array touched{press.node};
  if (!solver.touch(touched)) return rate;
  std::vector<double> times;
  for (int i = 1; i <= kRateSteps; ++i) {
    const std::array force{NodeForce{press.node, press.force_n * (i / double{kRateSteps})}};
    const auto begin = thread_cpu_ns();
    const auto report = solver.solve(force);
    times.push_back(static_cast<double>(thread_cpu_ns() - begin) * 1e-3);
    rate.iterations += report.iterations / double{kRateSteps};
    rate.factors += report.factors / double{kRateSteps};
  }
  std::ranges::sort(times);
  rate.median_us = times[times.size() / 2];
  rate.worst_us = times.back();
  return rate;
}

}  // namespace trocar::reduce
