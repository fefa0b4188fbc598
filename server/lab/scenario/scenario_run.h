#pragma once

// A scenario running: the engine of a session (step::Simulation) without people and network. Each
// step of a dynamic run is one tick, whose samples are the scenario's tools, whose decisions and
// policy are [run], and whose external loads are what the scenario moves and loads; so a scenario
// cuts, tears, publishes frames and takes snapshots as a session does. The state belongs to the
// run; nothing here reads a clock, so equal scenarios give equal results.
//
// A tick is 1 ms, solved in one or several equal steps of time; with boundary "frozen" only the
// queue around tools and loads is active. Two drivers act on the same state by other means: a step
// of a static run is a load step, in which time stands still until everything is in equilibrium
// with the loads and tools of that time, and the explicit integrator moves nodes in place of the
// solver. Values after a step are those at its end. One thread.

#include <optional>
#include <vector>

#include "server/lab/scenario/scenario.h"
#include "server/papers/nakao/explicit_euler.h"
#include "server/tissue/step/equilibrium.h"
#include "server/tissue/step/simulation.h"

namespace trocar::scenario {

enum class Solver : std::uint8_t {
  Live,  // the sweeps of [run], as in a session
  Full,  // sweeps until the residual is at most tolerance_n, at most max_sweeps
};

struct StepReport {
  dynamics::SolveReport solve;  // the last one's, with sweeps and rejected nodes of all
  std::size_t active_nodes = 0;
  bool is_converged = true;  // Solver::Full and static runs: the tolerance was reached
};

// Error: something in the scenario that is right but that the solver cannot do.
Status check_supported(const scenario::ResolvedScenario& resolved);

class ScenarioRun {
 public:
  // A scenario that check_supported() accepts. Settles it if it starts in equilibrium.
  // Results do not depend on the number of threads.
  ScenarioRun(scenario::ResolvedScenario resolved, Solver solver, unsigned threads = 1);
  ScenarioRun(const ScenarioRun&) = delete;
  ScenarioRun& operator=(const ScenarioRun&) = delete;

  StepReport step();

  std::uint64_t steps_done() const { return steps_done_; }
  std::uint64_t step_count() const { return step_count_; }
  bool is_finished() const { return steps_done_ >= step_count_; }
  double time_s() const;  // at the end of the last step
  // How the starting equilibrium was found; converged if there is none.
  const StepReport& settling() const { return settling_; }

  const scenario::ResolvedScenario& resolved() const { return resolved_; }
  const scenario::Scenario& scenario() const { return resolved_.scenario; }
  const organ::Organ& organ() const { return simulation_.organ(); }
  const world::World& world() const { return simulation_.state().world; }

  // A dynamic run that ticks: what it ticks, to be recorded, and what the last tick was told.
  bool has_ticks() const { return !is_static() && !explicit_; }
  step::Simulation& simulation() { return simulation_; }
  const step::Simulation& simulation() const { return simulation_; }
  // Whether it solves for the forces of averaged strain where a session may not.
  bool has_implicit_strain() const;
  const hands::TickInputs& inputs() const { return inputs_; }
  const step::TickDecisions& decisions() const { return decisions_; }

  // The longest step of the explicit integrator, s; nothing without it.
  std::optional<double> stable_dt_s() const {
    return explicit_ ? std::optional(explicit_->stable_dt_s()) : std::nullopt;
  }
  // Returns where the tool's tip is after a step, m; the origin before the tool has appeared.
  Vec3d tool_tip(std::size_t tool) const {
    return to_double(
        simulation_.state().tools[ToolSlot{static_cast<std::uint8_t>(tool)}].pose.position);
  }
  // How many tets are inside out now. O(tets).
  std::size_t inverted_tets() const;
  // Whether the probe has a value for the last step.
  bool is_due(std::size_t probe) const;
  // After at least one step: m, m/s or N.
  Vec3d probe(std::size_t index) const;

 private:
  bool is_static() const { return scenario().run.mode == scenario::RunMode::Static; }
  // The samples of the tools at this time; tools join in the first tick.
  void sample_tools(Tick tick, double time_s, bool has_samples);
  Vec3d force_on(ToolSlot tool) const;
  StepReport step_dynamic();
  StepReport step_explicit();
  StepReport step_static();
  StepReport report_of(const step::EquilibriumReport& found) const;
  void settle(unsigned threads);

  const scenario::ResolvedScenario resolved_;
  const Solver solver_kind_;
  const std::uint64_t step_count_;

  std::uint64_t steps_done_ = 0;
  StepReport settling_;
  step::Simulation simulation_;
  const step::TickDecisions decisions_;
  step::Equilibrium equilibrium_;
  std::vector<std::size_t> watched_;  // per probe: its number among the watched, of reactions

  // Steps use these members as workspace.
  hands::TickInputs inputs_;
  std::optional<nakao::ExplicitEuler> explicit_;
};

}  // namespace trocar::scenario
