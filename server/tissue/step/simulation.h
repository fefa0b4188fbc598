#pragma once

// The simulation as everybody outside sees it: inputs and decisions in, reports and frames out,
// snapshots both ways. Used by the server, by scenarios, by re-simulation of journals, and by
// tests. One thread at a time.

#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "server/tissue/step/tick.h"

namespace trocar::step {

// Checks ranges of what a person or a journal may choose; error names the field and the limit.
Status validate(const TickDecisions& decisions);

class Simulation {
 public:
  // workers: threads that may share the solver's work; results do not depend on it.
  explicit Simulation(organ::Organ organ, unsigned workers = 1, SceneRules rules = {});

  // Another one of the same organ and rules, at the beginning. Shares with this one what never
  // changes, so that they may be used by two threads.
  Simulation beside() const;

  // Returns these decisions with the sweeps that this organ needs, if they are Graded. In soft
  // tissue a node feels its own mass more than its neighbours in a tick: three sweeps where it is
  // touched, and fewer beyond, keep contact forces as near to the solved ones as more everywhere.
  TickDecisions with_sweeps_for_organ(TickDecisions decisions) const;

  unsigned workers() const { return workers_; }
  // From now on so many of them share the work; at first, and after a return to a mark, all do.
  void use_workers(unsigned count) { context_->solve.solver.use_workers(count); }

  // Simulates one tick. After a tick that publishes, pop_frame() has the frame. Returning to a
  // mark costs as much as beginning a session.
  const TickReport& tick(const hands::TickInputs& inputs, const TickDecisions& decisions);

  // The frame of the last tick, or null. Not yet shared, so the caller may add what is not
  // simulation: statistics, a snapshot for the journal. Frame f shows the state after tick 16 f.
  std::shared_ptr<PublishedFrame> pop_frame() { return std::move(context_->frame); }

  // Full state: all that the tick hash covers.
  void write_snapshot(Bytes& out) const;
  // Replaces the state, or leaves it as it was and says what is wrong with the bytes.
  Status restore_snapshot(BytesView snapshot);
  std::uint64_t state_hash() const;

  Tick current_tick() const { return state_->world.tick; }
  const wire::SurfaceLayout& layout() const { return state_->cuts.layout(); }
  const organ::Organ& organ() const { return scene_->organ; }
  const SceneRules& rules() const { return scene_->rules; }
  const State& state() const { return *state_; }
  const StepContext& context() const { return *context_; }
  // Whoever is interested in reactions watches them here.
  ExternalLoads& loads() { return *loads_; }
  const ExternalLoads& loads() const { return *loads_; }

  // The tissue begins so, m and m/s per node, at rest without velocities; relaxed stress is that of
  // having been there for long. Ticks go on from there as from a restored snapshot.
  void start_relaxed(std::span<const Vec3f> displacements, std::span<const Vec3f> velocities = {});
  // A tick of time in which another integrator moves the nodes, and nothing else happens.
  void tick_by(const std::function<void(world::World&)>& move);

 private:
  friend class Equilibrium;  // moves the same state without time

  Simulation(std::shared_ptr<const Scene> scene, unsigned workers);

  void use_mark(hands::MarkAction action, std::uint8_t number);
  // Null: the state is of another far-field model.
  std::unique_ptr<StepContext> context_of(State& state) const;

  std::shared_ptr<const Scene> scene_;
  unsigned workers_ = 1;
  std::unique_ptr<State> state_;
  std::unique_ptr<StepContext> context_;
  std::unique_ptr<ExternalLoads> loads_;
};

}  // namespace trocar::step
