#pragma once

// How far a local reduction is from the full model: at places of its training under other forces,
// and at places at least 8 mm from all of these.
//
// Errors: L2 of the displacement field over all nodes; of the loaded node's displacement; of the
// force on it where it is held at the full solution's place. Each beside the full one's norm.

#include "server/lab/reduce/errors.h"
#include "server/lab/reduce/local_build.h"
#include "server/lab/reduce/local_solver.h"

namespace trocar::reduce {

inline constexpr double kFarFromTraining_m = 0.008;

struct LocalLoad {
  Press press;
  bool is_trained = false;
  Vector displacements;  // of the full model
};
// Two forces, 0.3 and 0.85 of the largest of the training, at each place. Loads without an
// equilibrium are left out.
std::vector<LocalLoad> solve_local_loads(
    FullModel& model, const LocalBuilt& built, std::size_t trained_places,
    std::size_t unseen_places, const std::function<void(std::size_t, std::size_t)>& progress = {});

struct LocalErrors {
  std::vector<double> field, contact, force;  // per load
  std::size_t unsolved = 0;
  LocalSolver::Sizes largest;  // with the most unknowns
};
LocalErrors errors_of_local(const organ::LocalReduction& reduction, const organ::Organ& organ,
                            std::span<const LocalLoad> loads, bool trained);

// Two presses at once, on the second loads of places in turn: mean of the two contacts. Loads
// without an equilibrium of the full model are left out.
LocalErrors errors_of_pairs(FullModel& model, const organ::LocalReduction& reduction,
                            std::span<const LocalLoad> loads, std::size_t pairs);

// A press that grows from nothing in 100 steps, each from the one before.
struct LocalRate {
  double median_us = 0, worst_us = 0;  // thread CPU time per step
  double iterations = 0, factors = 0;  // mean per step
};
LocalRate rate_of_local(const organ::LocalReduction& reduction, const organ::Organ& organ,
                        const Press& press);

}  // namespace trocar::reduce
