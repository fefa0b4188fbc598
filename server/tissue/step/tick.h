#pragma once

// One tick: a pure function of (state, admitted inputs, decisions). tick.cpp is the table of
// contents.

#include <memory>

#include "common/base/checksum.h"
#include "server/tissue/blades/tissue_cuts.h"
#include "server/tissue/contact/contact_finder.h"
#include "server/tissue/contact/self_contact.h"
#include "server/tissue/dynamics/block_descent.h"
#include "server/tissue/dynamics/far_field_model.h"
#include "server/tissue/hands/claims.h"
#include "server/tissue/hands/tool_table.h"
#include "server/tissue/propagation/active_set.h"
#include "server/tissue/propagation/queue.h"
#include "server/tissue/step/external_loads.h"
#include "server/tissue/step/mark.h"
#include "server/tissue/step/published_frame.h"
#include "server/tissue/step/tick_report.h"
#include "server/tissue/world/world.h"

namespace trocar::step {

static_assert(kSweepLayers <= dynamics::kMaxSweepBands);

// Everything a later tick depends on. Each member names its arrays in visit_state; these bytes are
// the snapshot and what the tick hash covers.
struct State {
  // models: null: sweeps alone move the tissue.
  State(const organ::Organ& organ, const dynamics::FarFieldModels* models,
        const cutting::Settings& cutting);

  blades::TissueCuts cuts;
  world::World world;
  hands::ToolTable tools;
  hands::ClaimTable claims;
  contact::GraspTable grasps;
  contact::ProxyTable proxies;
  // Last published integers: quantisation has hysteresis, so they are state.
  wire::QuantisedSurface quantised;
  contact::SelfContactTable self_contacts;
  const dynamics::FarFieldModels* const far_models;
  std::unique_ptr<dynamics::FarFieldModel> far_model;  // of sessions with models
  Mark mark;

  void visit(world::StateArchive& archive);

  void set_mark();
  // The organ as it was marked, with the tools as they are now, which hold nothing; time goes on.
  // Null: there is no mark.
  std::unique_ptr<State> returned_to_mark(const organ::Organ& organ) const;

 private:
  void visit_without_mark(world::StateArchive& archive);
};

// Constant in a session: follows from the organ.
struct Scene {
  organ::Organ organ;
  cutting::Settings cutting;
  std::unique_ptr<const dynamics::FarFieldModels> far_models;  // of it where it stays; null: none
};

// Laid out as input, scratch and output of a tick. Scratch keeps its capacity, so that a tick does
// not allocate after warm-up; nothing in it outlives a tick's meaning.
struct StepContext {
  StepContext(const Scene& scene, unsigned workers, const State& state);
  // uncut: the world of the organ as it was at first.
  StepContext(const Scene& scene, unsigned workers, const world::World& uncut, const State& state);

  // Input.
  const Scene& scene;
  const hands::TickInputs* inputs = nullptr;
  TickDecisions decisions;
  ExternalLoads* loads = nullptr;  // null: only tools act

  // Scratch and stage results, valid from their stage to the end of the tick.
  contact::ContactFinder finder;
  contact::SelfContactFinder self_finder;
  contact::ContactList contacts;
  propagation::Neighbours neighbours;
  propagation::PropagationQueue queue;
  propagation::ActiveSet active;
  std::array<dynamics::SweepBand, kSweepLayers> sweep_bands{};  // of active nodes, by layer
  dynamics::BlockDescent solver;
  dynamics::FarPlan far_plan;
  bool has_linear_far_field;
  // By tool, empty without contact; then tissue on tissue; then external loads.
  std::vector<std::span<const NodeIndex>> seeds;
  std::vector<hands::ClaimRequest> requests;
  std::vector<Vec3f> surface_displacements;
  std::vector<NodeIndex> may_tear;
  double travel_m = 0;  // sum over ticks of the farthest that any node has moved
  StateHasher hasher;

  // Output.
  std::vector<hands::ClaimEvent> claim_events;  // gathered until published
  std::vector<MarkEvent> mark_events;           // likewise
  std::vector<SolverChange> solver_changes;     // likewise
  SolverFigures solver_figures;                 // of the last tick
  std::shared_ptr<PublishedFrame> frame;        // set by the publish stage
  TickReport report;
};

// The stages, in order, each timed.
void run_tick(State& state, StepContext& context);

// Stages that other drivers of the same state use: those that look for equilibria.
//
// Tools come and go, and move one step.
void admit_inputs(State& state, StepContext& context);
// After the solve: proxies go where the surface lets them.
void follow_contacts(State& state, StepContext& context);
// Who holds what from the next tick.
void update_claims(State& state, StepContext& context);

}  // namespace trocar::step
