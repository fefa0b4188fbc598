#pragma once

// A scenario running: the engine of a session without people, network and frames. Each step moves
// what the scenario moves, loads what it loads, lets its tools act by the rules of a session, and
// solves. The state belongs to the run; nothing here reads a clock, so equal scenarios give equal
// results.
//
// A step of a dynamic run is a tick of 1 ms, solved in one or several equal steps of time; with
// boundary "frozen" only the queue around tools and loads is active, as in a session. A step of a
// static run is a load step: time stands still until everything is in equilibrium with the loads
// and tools of that time. Values after a step are those at its end. One thread.

#include <optional>
#include <vector>

#include "server/lab/scenario/scenario.h"
#include "server/papers/nakao/explicit_euler.h"
#include "server/tissue/contact/contact_finder.h"
#include "server/tissue/contact/self_contact.h"
#include "server/tissue/dynamics/block_descent.h"
#include "server/tissue/hands/claims.h"
#include "server/tissue/hands/tool_table.h"
#include "server/tissue/propagation/active_set.h"
#include "server/tissue/propagation/queue.h"
#include "server/tissue/world/world.h"

namespace trocar::scenario {

enum class Solver : std::uint8_t {
  Live,  // the sweeps of [run], as in a session
  Full,  // sweeps until the residual is at most tolerance_n, at most max_sweeps
};

struct StepReport {
  dynamics::SolveReport solve;  // the last one's, with the sweeps of all
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
  const organ::Organ& organ() const { return resolved_.organ; }
  const world::World& world() const { return world_; }

  // The longest step of the explicit integrator, s; nothing without it.
  std::optional<double> stable_dt_s() const {
    return explicit_ ? std::optional(explicit_->stable_dt_s()) : std::nullopt;
  }
  // Where a tool's tip is after a step; at the origin before it has appeared.
  Vec3d tool_tip(std::size_t tool) const {
    return to_double(tools_[ToolSlot{static_cast<std::uint8_t>(tool)}].pose.position);
  }
  // Whether the probe has a value for the last step.
  bool is_due(std::size_t probe) const;
  // After at least one step: m, m/s or N.
  Vec3d probe(std::size_t index) const;

 private:
  bool is_static() const { return scenario().run.mode == scenario::RunMode::Static; }
  void list_axis_holds();
  dynamics::AxisHold* axis_hold_of(NodeIndex node);
  void apply_loads(double time_s);
  Vec3d holding_force(NodeIndex node) const;
  void move_tools(double time_s, bool takes_samples);
  // What is swept this step, most of all in a graded one.
  std::span<const NodeIndex> collect_active();
  void follow_contacts();
  dynamics::SolveSettings settings() const;
  StepReport step_dynamic();
  StepReport step_static();
  // Sweeps until nothing is out of balance by more than the tolerance; everything is at rest then.
  StepReport relax();
  // Held and displaced nodes go where the loads of now have them.
  void place_held();
  // Elastic energy minus the work of loads and gravity, J. O(nodes).
  double potential_energy_j() const;
  StepReport relax_for_long(unsigned threads);

  const scenario::ResolvedScenario resolved_;
  const Solver solver_kind_;
  const scenario::Boundary boundary_;
  const std::uint64_t step_count_;

  std::uint64_t steps_done_ = 0;
  StepReport settling_;

  world::World world_;
  hands::ToolTable tools_;
  hands::ClaimTable claims_;
  contact::GraspTable grasps_;
  contact::ProxyTable proxies_;
  contact::SelfContactTable self_contacts_;

  // Scratch of a step.
  hands::TickInputs inputs_;
  contact::ContactFinder finder_;
  std::optional<contact::SelfContactFinder> self_finder_;  // where tissue is kept from tissue
  contact::ContactList contacts_;
  propagation::PropagationQueue queue_;
  propagation::ActiveSet active_set_;
  dynamics::BlockDescent solver_;
  std::optional<nakao::ExplicitEuler> explicit_;
  dynamics::FarPlan far_plan_;                  // graded
  std::vector<Vec3f> forces_;                   // per node; empty without loads
  std::vector<NodeIndex> held_;                 // fixed, then displaced nodes
  std::vector<Vec3f> held_displacements_;       // per entry of held_
  std::vector<dynamics::AxisHold> axis_holds_;  // by node
  std::vector<NodeIndex> free_nodes_;           // what is active unless frozen
  std::vector<Vec3f> before_;                   // displacements before a round of contacts
  std::vector<Vec3f> before_stretch_;           // displacements before a stretch of sweeps
  std::vector<std::span<const NodeIndex>> seeds_;
  std::vector<hands::ClaimRequest> requests_;
  std::vector<hands::ClaimEvent> claim_events_;
};

}  // namespace trocar::scenario
