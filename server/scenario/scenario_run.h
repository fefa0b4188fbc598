#pragma once

// A scenario running: the engine of a session without people, network and frames. Each step of 1 ms
// moves what the scenario moves, loads what it loads, lets its tools act by the rules of a session,
// and solves. The state belongs to the run; nothing here reads a clock, so equal scenarios give
// equal results.
//
// Without limits in [run] every free node is active in every step; with depth or nodes only the
// queue around tools and loads is, as in a session. Values after a step are those at its end: step
// n ends at n ms. One thread.

#include <memory>
#include <vector>

#include "common/scene/scenario.h"
#include "server/contact/contact_list.h"
#include "server/contact/grasps.h"
#include "server/dynamics/block_descent.h"
#include "server/input/tool_table.h"
#include "server/locks/claims.h"
#include "server/propagation/active_set.h"
#include "server/propagation/queue.h"
#include "server/world/world.h"

namespace trocar::scenario {

enum class Solver : std::uint8_t {
  Live,  // the sweeps of [run], as in a session
  Full,  // sweeps until the residual is at most tolerance_n, at most max_sweeps
};

struct StepReport {
  dynamics::SolveReport solve;
  std::size_t active_nodes = 0;
  bool is_converged = true;  // Solver::Full: the tolerance was reached
};

class ScenarioRun {
 public:
  ScenarioRun(scene::ResolvedScenario resolved, Solver solver);
  ScenarioRun(const ScenarioRun&) = delete;
  ScenarioRun& operator=(const ScenarioRun&) = delete;

  StepReport step();

  Tick tick() const { return world_.tick; }
  Tick last_tick() const { return last_tick_; }
  bool is_finished() const { return world_.tick >= last_tick_; }

  const scene::Scenario& scenario() const { return resolved_.scenario; }
  const scene::Organ& organ() const { return resolved_.organ; }
  const world::World& world() const { return world_; }

  // After at least one step: m, m/s or N.
  Vec3d probe(std::size_t index) const;

 private:
  void apply_loads();
  void move_tools();
  void collect_active();
  void update_claims();

  const scene::ResolvedScenario resolved_;
  const Solver solver_kind_;
  const bool has_limits_;
  const Tick last_tick_;

  world::World world_;
  input::ToolTable tools_;
  locks::ClaimTable claims_;
  contact::GraspTable grasps_;

  // Scratch of a step.
  session::TickInputs inputs_;
  contact::ContactList contacts_;
  propagation::PropagationQueue queue_;
  propagation::ActiveSet active_set_;
  dynamics::BlockDescent solver_;
  std::vector<Vec3f> forces_;              // per node; empty without loads
  std::vector<NodeIndex> held_;            // fixed, then displaced nodes
  std::vector<Vec3f> held_displacements_;  // per entry of held_
  std::vector<NodeIndex> free_nodes_;      // what is active without limits
  std::vector<std::span<const NodeIndex>> seeds_;
  std::vector<locks::ClaimRequest> requests_;
  std::vector<locks::ClaimEvent> claim_events_;
};

}  // namespace trocar::scenario
