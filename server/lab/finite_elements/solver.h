#pragma once

// The off-line solver: large deformation, nonlinear materials, relaxation, in double precision.
// Newton's method with the consistent tangent, a line search and sparse Cholesky factors (CHOLMOD),
// over steps of load and time. The live solver (server/tissue/dynamics) is compared with it; no
// tick uses it.
//
// A step of dt_s:
//   0, without inertia         a sudden load: nothing relaxes
//   infinite, without inertia  the equilibrium when all that can relax has relaxed
//   finite, without inertia    quasi-static: slow loads
//   finite, with inertia       generalised-alpha (Chung & Hulbert 1993): second order in dt and
//                              unconditionally stable, with damping of what a step does not resolve
//                              set by one number; backward Euler, as the live solver has, would
//                              damp the motion that is to be a reference
// Forces are dead loads. A step that Newton's method does not manage is done in halves. Time per
// iteration is that of the factors, O(n^2) for a solid of n nodes; memory O(n^(4/3)).
// Errors: none thrown; a report that has not converged leaves the state of the last part that did.
// One caller; elements are assembled on `threads`.

#include <functional>
#include <memory>

#include "server/lab/finite_elements/assembler.h"
#include "server/lab/finite_elements/sparse_factors.h"

namespace trocar::finite_elements {

struct Loads {
  Vector forces;                   // N, 3 per node
  std::vector<double> held_moves;  // m, per entry of Problem::held_dofs
};
Loads no_loads(const Problem& problem);

struct StepSettings {
  double dt_s = 0;
  bool has_inertia = false;
};

struct SolverSettings {
  unsigned threads = 2;
  // Residual over the norm of all forces, reactions included, at which Newton's method ends.
  double tolerance = 1e-9;
  int max_iterations = 40;  // of a part of a step
  int max_halvings = 8;     // of a step
  // Spectral radius at infinite frequency: 1 damps nothing, 0 all that a step does not resolve.
  double high_frequency_radius = 0.8;
};

// How a state was come to: a hash of every step's loads and settings, from 0 before the first.
std::uint64_t path_after(std::uint64_t path, const Loads& loads, const StepSettings& settings);

struct StepReport {
  bool is_converged = true;
  int parts = 0, iterations = 0, shifted_factors = 0;
  double residual_n = 0;  // norm over the free degrees of freedom
};

// The progress says where a step is, after each iteration.
struct NewtonProgress {
  double part_done = 0;  // of the step
  int iteration = 0;
  double residual_n = 0, tolerance_n = 0;
};

// All that changes.
struct State {
  double time_s = 0;  // of finite steps
  std::uint64_t steps = 0;
  std::uint64_t path = 0;                      // path_after() all steps so far
  bool is_moving = false;                      // the last step had inertia
  Vector u, velocity, acceleration, internal;  // 3 per node; forces of the tissue
  Loads loads;                                 // at the end of the last step
  std::vector<double> history;                 // relaxation, of the assembler
};

class Solver {
 public:
  // A problem that validate() accepts.
  Solver(Problem problem, const SolverSettings& settings = {});
  Solver(const Solver&) = delete;
  Solver& operator=(const Solver&) = delete;

  // From the last loads to these, linearly in the step.
  StepReport step(const Loads& loads, const StepSettings& settings);

  // From now on these forces act, and nothing has moved yet: a step with inertia starts with them.
  void set_forces(const Vector& forces);

  const Problem& problem() const { return problem_; }
  const Vector& displacements() const { return u_; }
  const Vector& velocities() const { return velocity_; }
  double time_s() const { return time_s_; }
  // Returns what holds and loads the tissue, 3 per node, N: at held degrees of freedom the
  // reactions on the tissue, inertia and damping included; at free ones the loads.
  Vector reactions() const;
  // Weights of all nodes, 3 per node, N.
  Vector weights(const Vec3d& gravity_m_s2) const;

  State state() const;
  // Takes over a state of the same problem.
  void restore(const State& state);

  std::function<void(const NewtonProgress&)> on_progress;

 private:
  // A part of a step: from the state to loads at its end.
  struct Part {
    const Loads& loads;
    StepSettings settings;
  };
  struct Residual {
    bool is_admissible = false;
    Vector values;     // 3 per node, held ones too
    double scale = 0;  // norm of the forces in it
  };
  bool solve_part(const Part& part, double part_done, StepReport& report);
  void start_motion();
  void set_alphas(const Part& part);
  Vector acceleration_at(const Vector& u) const;
  Vector velocity_at(const Vector& acceleration) const;
  Residual residual_of(const Vector& u, const Part& part, const Vector& internal) const;
  Residual residual_at(const Vector& u, const Part& part);
  bool factor(StepReport& report);
  double line_search(const Vector& u, const Vector& change, const Part& part,
                     const Residual& before);
  void accept(const Vector& u, const Part& part);
  Vector free_part(const Vector& all) const;
  void add_free(const Vector& free, Vector& all) const;
  double norm_of_free(const Vector& all) const;

  const Problem problem_;
  const SolverSettings settings_;
  Assembler assembler_;
  SparseMatrix tangent_;
  SparseFactors factors_;
  double least_force_n_ = 0;  // rounding errors of forces are below

  double time_s_ = 0;
  std::uint64_t steps_ = 0, path_ = 0;
  Vector u_, velocity_, acceleration_;
  Vector internal_;  // forces at the end of the last step
  Loads loads_;
  bool is_moving_ = false;  // acceleration_ is in balance with the loads

  // A step with inertia has weights of its start, and Newmark's numbers.
  double alpha_f_ = 0, alpha_m_ = 0, beta_ = 0.25, gamma_ = 0.5, dt_s_ = 0;
};

}  // namespace trocar::finite_elements
