#pragma once

// A tick is told its TickDecisions, and says in a TickReport what it did.

#include <array>
#include <cstdint>

#include "common/base/tick.h"
#include "common/wire/figures.h"
#include "server/tissue/blades/cut_report.h"
#include "server/tissue/propagation/active_set.h"
#include "server/tissue/world/world.h"

namespace trocar::step {

using wire::kStageCount, wire::kSweepLayers, wire::LayerCounts, wire::Stage;

// How exactly a tick is solved. A session has the default; an experiment may want more.
struct TickPolicy {
  std::uint32_t steps_per_tick = 1;  // The solver takes so many equal steps of time in a tick.
  // Above 0: sweeps go on until the residual is at most this, at most max_sweeps of them, and
  // TickDecisions::sweeps does not count. Not for Boundary::Graded.
  float residual_tolerance_n = 0;
  std::uint32_t max_sweeps = 2000;
  float far_over_relaxation = 0;  // Graded: of far nodes; 0: what the organ needs
  bool has_self_contact = true;   // Tissue does not pass through tissue.

  bool operator==(const TickPolicy&) const = default;
};
inline constexpr std::uint32_t kMaxStepsPerTick = 1000;
inline constexpr std::uint32_t kMaxPolicySweeps = 1'000'000;

// Decided between ticks, recorded in the journal. Defaults: decisions that everything shares.
struct TickDecisions {
  std::uint32_t depth_limit = 3;    // propagation layers
  std::uint32_t node_limit = 1200;  // nodes in the queue; may end inside a layer
  std::uint32_t sweeps = 4;
  float over_relaxation = 1.5f;  // 1 to 1.9; for fewer than 3 sweeps at most 1.3 is used

  world::Boundary boundary = world::Boundary::Graded;
  std::uint32_t far_sweeps = 0;  // Graded: of nodes outside the queue; 0: as the organ needs

  // These are the sweeps of layer 1, of layer 2, and of layers from 3 on together with nodes that
  // have left the queue. No number exceeds the one before; 0 repeats it. `sweeps` is then that of
  // the touched nodes.
  std::array<std::uint32_t, 3> layer_sweeps{};

  // Graded: forces in the far field from the energies, not from matrices about a recent pose.
  bool is_far_exact = false;
  std::uint32_t far_interval = 1;  // Graded: ticks from one sweep of a far node to the next

  // Graded: nodes that have left the queue stay active for so long.
  std::uint32_t linger_ticks = propagation::kQuietTicks;

  // Bits of tools: their blades stop where they are, and the hands feel it (blades/blades.h); tips
  // that press, and jaws that hold, go on slowly (contact/contact_list.h).
  std::uint32_t waiting_tools = 0;

  TickPolicy policy;

  bool operator==(const TickDecisions&) const = default;
};
LayerCounts sweeps_of_layers(const TickDecisions& decisions);

inline constexpr std::uint32_t kMaxDepthLimit = 1000;
inline constexpr std::uint32_t kMaxNodeLimit = 10'000'000;
inline constexpr std::uint32_t kMaxSweeps = 64;
inline constexpr std::uint32_t kMaxFarSweeps = 16;
inline constexpr std::uint32_t kMaxFarInterval = 3;
// Layers where nodes outside the queue stand still: shallower ones feel stiff.
inline constexpr std::uint32_t kFrozenDepthLimit = 6;

// Error bits: what was dropped or degraded, and which limit to raise.
enum TickFault : std::uint32_t {
  kFaultInputDropped = 1u << 0,    // an input did not fit the state (empty slot, no such tool)
  kFaultContactLimit = 1u << 1,    // more contact nodes than the contact list holds
  kFaultOverRelaxation = 1u << 2,  // residual grew: the tick went on without over-relaxation
  kFaultToolInside = 1u << 4,      // a tool appeared inside tissue: draw it back to touch
  kFaultNonFinite = 1u << 3,       // a node's step was not finite: its region went back a tick
  kFaultCutLimit = 1u << 5,        // the surface has as many triangles as may be: blades are blunt
};

struct ContactReport {
  std::uint32_t nodes = 0;       // that tools touch
  std::uint32_t self_pairs = 0;  // of tissue near tissue, see server/tissue/contact/self_contact.h
  bool is_full = false;          // see kFaultContactLimit
  bool has_tool_inside = false;  // see kFaultToolInside
};

struct SolveReport {
  wire::SolveFigures figures;
  LayerCounts layer_nodes{};          // active nodes that are not fixed, as in sweeps_of_layers()
  std::uint64_t node_sweeps = 0;      // nodes stepped by the solver, all sweeps together
  std::uint64_t far_node_sweeps = 0;  // of these, nodes outside the queue
  bool is_far_linear = false;         // these were stepped by matrices
  std::uint32_t nodes_rejected = 0;   // see kFaultNonFinite
  std::uint32_t nodes_restored = 0;   // likewise: put back, at rest
  bool is_stepped_down = false;       // see kFaultOverRelaxation
  bool is_converged = true;           // unless a step missed TickPolicy's tolerance
  float largest_move_m = 0;           // of a node in the whole tick, at most
};

struct TieReport {
  std::uint32_t whole = 0;   // neither broken nor gone
  std::uint32_t broken = 0;  // in this tick
};

// Each stage says this about itself.
struct TickReport {
  Tick tick = 0;
  std::array<std::uint32_t, kStageCount> stage_cpu_ns{};
  std::uint32_t inputs_dropped = 0;
  ContactReport contact;
  wire::NearFigures near;
  SolveReport solve;
  TieReport ties;
  blades::CutReport cut;
  std::uint32_t faults = 0;  // TickFault bits
  std::uint64_t state_hash = 0;
};
std::uint32_t faults_of(const TickReport& report);

}  // namespace trocar::step
