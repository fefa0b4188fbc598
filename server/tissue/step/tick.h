#pragma once

// One tick is a pure function of (state, admitted inputs, decisions). run_tick in tick.cpp is the
// table of contents, and each stage says in its signature what it reads and what it writes.

#include <memory>
#include <optional>

#include "common/base/checksum.h"
#include "server/tissue/blades/tissue_cuts.h"
#include "server/tissue/bleeding/bleeding.h"
#include "server/tissue/contact/contact_finder.h"
#include "server/tissue/contact/self_contact.h"
#include "server/tissue/dynamics/block_descent.h"
#include "server/tissue/hands/claims.h"
#include "server/tissue/hands/tool_table.h"
#include "server/tissue/pieces/pieces.h"
#include "server/tissue/propagation/active_set.h"
#include "server/tissue/propagation/queue.h"
#include "server/tissue/step/external_loads.h"
#include "server/tissue/step/mark.h"
#include "server/tissue/step/published_frame.h"
#include "server/tissue/step/tick_report.h"
#include "server/tissue/thread/threads.h"
#include "server/tissue/touch/touch_table.h"
#include "server/tissue/world/world.h"

namespace trocar::step {

static_assert(kSweepLayers <= dynamics::kMaxSweepBands);

// By these rules a scene goes on. The default: those of a session in which nothing bleeds, without
// threads.
struct SceneRules {
  // How blades cut. A method that moves nodes of the mesh needs the boundary whole and no
  // self-contact, and its states cannot be restored.
  cutting::Settings cutting;
  LoadRules loads;  // what acts besides tools, of a scenario that validate() accepts
  // It says when forces of averaged strain are taken; nothing: as dynamics::scheme_for() says for
  // ticks of a session. Equilibria, and ticks that are solved to a tolerance, want it Implicit.
  std::optional<dynamics::StrainScheme> strain_scheme;
  std::optional<bleeding::Rules> bleeding;  // of a session that bleeds
  std::optional<thread::Rules> threads;     // of one with threads
};

// A scene is what is constant in a session.
struct Scene {
  organ::Organ organ;
  SceneRules rules;
  dynamics::StrainScheme strain_scheme = dynamics::StrainScheme::Implicit;  // as chosen
};

// Everything a later tick depends on. Each member names its arrays in visit_state; these bytes are
// the snapshot and what the tick hash covers.
struct State {
  // The organ at rest, with what the scene displaces held.
  explicit State(const Scene& scene);

  blades::TissueCuts cuts;
  world::World world;
  hands::ToolTable tools;
  hands::ClaimTable claims;
  contact::GraspTable grasps;
  contact::ProxyTable proxies;
  // Last published integers: quantisation has hysteresis, so they are state.
  wire::QuantisedSurface quantised;
  contact::SelfContactTable self_contacts;
  const dynamics::StrainScheme strain_scheme;  // forces of relaxed stress are as it has them
  std::optional<bleeding::Blood> blood;        // of a session that bleeds
  std::optional<thread::Threads> threads;      // of one with threads
  Marks marks;

  void visit(world::StateArchive& archive);

  void set_mark(std::uint8_t number);
  // The organ as it was marked, with the tools as they are now, which hold nothing; time goes on.
  // Null: there is no such mark.
  std::unique_ptr<State> returned_to_mark(std::uint8_t number, const Scene& scene) const;

 private:
  void visit_without_marks(world::StateArchive& archive);
};

// The stages keep these structs from tick to tick, so that none begins anew or allocates after
// warm-up. Nothing in them is state: all of it follows from the state, the edits and the last tick.

struct ContactWork {
  contact::ContactFinder finder;
  contact::SelfContactFinder self_finder;
  contact::ContactList found;
  std::vector<hands::ClaimRequest> requests;  // scratch of the claims, points into `found`
};

// These nodes are solved most.
struct NearWork {
  propagation::Neighbours neighbours;
  propagation::PropagationQueue queue;
  propagation::ActiveSet active;
  // By tool, empty without contact; then tissue on tissue; then external loads.
  std::vector<std::span<const NodeIndex>> seeds;
};

struct SolveWork {
  SolveWork(const Scene& scene, unsigned workers, const world::World& uncut);

  dynamics::BlockDescent solver;
  dynamics::FarPlan far_plan;
  bool has_linear_far_field, has_tension;
  std::array<dynamics::SweepBand, kSweepLayers> bands{};  // of swept nodes, by layer
};

struct BleedWork {
  explicit BleedWork(const bleeding::Rules& rules) : bleeding(rules) {}

  bleeding::Bleeding bleeding;
  std::vector<bleeding::ToolAtWork> tools;
};

struct ThreadWork;  // server/tissue/step/thread_stage.h

struct CutWork {
  std::vector<NodeIndex> may_tear;
  std::vector<std::uint32_t> held_pieces;  // each as often as tools hold it
  double travel_m = 0;                     // sum over ticks of the farthest that any node has moved
};

// Events wait here for the next frame.
struct Outbox {
  std::vector<hands::ClaimEvent> claim_events;
  std::vector<MarkEvent> mark_events;
};

struct StepContext {
  StepContext(const Scene& scene, unsigned workers, State& state);
  // uncut: the world of the organ as it was at first.
  StepContext(const Scene& scene, unsigned workers, const world::World& uncut, State& state);

  ContactWork contact;
  NearWork near;
  SolveWork solve;
  pieces::Pieces pieces;
  CutWork cut;
  std::optional<BleedWork> bleed;       // of a session that bleeds
  std::shared_ptr<ThreadWork> threads;  // of one with threads; of this context alone
  touch::TouchTable touches;
  std::vector<Vec3f> surface_displacements;  // scratch of the publish stage
  StateHasher hasher;
  Outbox outbox;
  std::shared_ptr<PublishedFrame> frame;  // set by the publish stage
  TickReport report;
};

// The stages run in order, each timed. loads: null: only tools act.
void run_tick(const hands::TickInputs& inputs, const TickDecisions& decisions, ExternalLoads* loads,
              State& state, StepContext& context);

// Tools come and go, and move one step. Returns how many inputs were dropped. Drivers that look for
// equilibria of the same state use it too.
std::uint32_t admit_inputs(const hands::TickInputs& inputs, Tick tick, hands::ToolTable& tools,
                           hands::ClaimTable& claims, contact::GraspTable& grasps);

}  // namespace trocar::step
