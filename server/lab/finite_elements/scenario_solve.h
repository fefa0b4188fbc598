#pragma once

// A scenario on the off-line solver: the same organ, holds, loads and probes as ScenarioRun's, with
// tools, springs and prestress left out. A static run takes the loads of each load step as sudden
// ones or waits for equilibrium; a dynamic run takes steps of dt_s with inertia and the organ's
// node damping (that of edges is not here: relaxation is what damps).
//
// Quadratic elements: the middle of an edge is held or moved where both ends belong to one set, and
// tractions are consistent; forces on sets stay on the mesh's own nodes. One caller.

#include <filesystem>
#include <memory>
#include <optional>

#include "server/lab/finite_elements/solver.h"
#include "server/lab/scenario/scenario.h"

namespace trocar::finite_elements {

struct ScenarioSettings {
  ElementOrder order = ElementOrder::Quadratic;
  // Replaces the organ's own material; regions keep theirs.
  std::optional<material::HyperelasticMaterial> material;
  bool is_equilibrium = false;  // static runs: after all relaxation
  double dt_s = 1e-3;           // dynamic runs
  SolverSettings solver;
};

class ScenarioSolve {
 public:
  // Error: something in the scenario that this solver does not do.
  static Result<std::unique_ptr<ScenarioSolve>> create(scenario::ResolvedScenario resolved,
                                                       const ScenarioSettings& settings);

  // Advances by one load step or step of time.
  StepReport step();

  std::uint64_t steps_done() const { return steps_done_; }
  std::uint64_t step_count() const { return step_count_; }
  bool is_finished() const { return steps_done_ >= step_count_; }
  // Returns the scenario's time at the end of the last step.
  double time_s() const { return time_after(steps_done_); }
  // The state at time 0, which the first step makes if nobody has: how its equilibrium was found.
  const StepReport& start();

  // Whether the probe has a value for the last step.
  bool is_due(std::size_t probe) const;
  Vec3d probe(std::size_t index) const;  // m, m/s or N
  // These return values of the organ's own nodes.
  std::vector<Vec3d> displacements() const;
  std::vector<Vec3d> velocities() const;
  std::vector<std::uint8_t> held_nodes() const;

  const scenario::ResolvedScenario& resolved() const { return resolved_; }
  Solver& solver() { return *solver_; }
  const Solver& solver() const { return *solver_; }

  // Goes on from a state of the same problem; refuses one that is not at a step of this scenario,
  // or that other loads or steps have led to. Time: that of the loads of all steps done.
  Status resume(const std::filesystem::path& path);
  Status save(const std::filesystem::path& path) const;

 private:
  ScenarioSolve(scenario::ResolvedScenario resolved, const ScenarioSettings& settings);
  Status make_problem_of(Problem& problem);
  Status add_materials(Problem& problem) const;
  void add_holds(Problem& problem);
  void add_forces();
  Loads loads_at(double time_s) const;
  double time_after(std::uint64_t steps) const;
  bool starts_in_equilibrium() const;
  Loads start_loads() const;
  StepSettings start_settings() const;
  StepSettings step_settings() const;
  std::uint64_t path_to(std::uint64_t steps) const;
  bool is_static() const { return resolved_.scenario.run.mode == scenario::RunMode::Static; }
  // The nodes and the middles of edges between them.
  std::vector<std::uint32_t> with_middles(const scenario::NodeList& nodes,
                                          const ElementMesh& mesh) const;

  const scenario::ResolvedScenario resolved_;
  const ScenarioSettings settings_;
  std::uint64_t step_count_ = 0, steps_done_ = 0;
  std::unique_ptr<Solver> solver_;
  StepReport settling_;
  bool is_started_ = false;
  std::vector<std::int32_t> held_rules_;           // per held dof: displacement, or -1: stays
  Vector weight_;                                  // of gravity
  std::vector<std::vector<double>> area_shares_;   // per entry of forces, if a traction
  std::vector<std::vector<Vec3d>> normal_shares_;  // the same, if a pressure
  std::vector<std::vector<std::uint32_t>> probe_nodes_;
};

}  // namespace trocar::finite_elements
