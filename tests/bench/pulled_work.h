#pragma once

// Works that pull a box: by the engine, and by Bullet. Each is judged by the mean displacement of
// the loaded face at 0.1 s against the same mesh, law and step solved to convergence, which is
// computed once per box and law and kept.

#include "tests/bench/bench_run.h"
#include "tests/bench/bullet_peer.h"
#include "tests/bench/our_solver.h"
#include "tests/bench/pulled_box.h"

namespace trocar::bench {

inline constexpr double kCompareAtSeconds = 0.1;

using SharedBox = std::shared_ptr<const PulledBox>;

// A row with the box's counts.
Row row_of(const PulledBox& box, std::string group, std::string solver);
std::string title_of(Law law, const SolverOptions& options);

Work pull_by_bullet(SharedBox box, BulletLaw law, bool is_implicit, double dt_s);
Work pull_by_us(SharedBox box, const SolverOptions& options, bool is_judged);

}  // namespace trocar::bench
