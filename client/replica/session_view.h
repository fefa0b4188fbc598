#pragma once

// A client keeps what it knows of the session in these plain types: nothing above the replica sees
// a Protobuf message. Metres, world frame.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "common/base/ids.h"
#include "common/base/tick.h"
#include "common/tool/tool.h"
#include "common/wire/quantise.h"
#include "common/wire/role.h"

namespace trocar::replica {

using wire::has_tools;
using wire::name_of;
using wire::Role;

struct Participant {
  ParticipantSlot slot;
  std::string name;
  Role role = Role::Unknown;
  std::vector<tool::ToolShape> tools;
};

struct Tool {
  ToolSlot slot;
  Pose world_from_tool;
  Pose world_from_proxy;  // where the tissue lets it be
  tool::Verb verb = tool::Verb::None;
  Vec3f force_n, torque_nm;  // of the tissue on the tool, torque about its tip
  std::uint32_t contact_nodes = 0;
  float penetration_m = 0;  // deepest contact
  bool has_claim = false;   // its push or grasp is in effect
  bool is_inside = false;   // appeared inside tissue: touches nothing until it has come out
  bool is_silent = false;   // no sample for 250 ticks
};

// The surface at rest is given per vertex slot and triangle number; both only grow within a
// session.
struct Topology {
  std::uint32_t epoch = 0;
  std::string organ_name;
  std::vector<Vec3f> rest_positions;
  // Outward, indices into rest_positions; a removed one is 0, 0, 0: it has no area.
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<std::uint8_t> is_wound;  // per triangle: made by a blade
  std::vector<std::uint32_t> fixed_vertices;
};

// The server's rate controller decided this for a frame's tick.
enum class RateLevel : std::uint8_t {
  Fixed = 0,       // there is no controller
  Full = 1,        // all that was asked for
  Reduced = 2,     // less, so that the tick keeps its time
  Overloaded = 3,  // the least, and still too much: simulated time slows
};
inline constexpr std::size_t kMaxSweepLayers = 16;

struct RateFigures {
  RateLevel level = RateLevel::Fixed;
  std::vector<std::uint32_t> layer_sweeps;  // of touched nodes, layer 1, layer 2, all beyond
  std::uint32_t node_limit = 0;             // 0: the server did not say
  float budget_us = 0;                      // of a tick's time for its work; 0: none is kept
  float predicted_us = 0;                   // what the next tick will take
  std::uint64_t lowered = 0, raised = 0;    // steps in the whole session
  float time_rate = 1;                      // simulated time over real time, last second

  bool operator==(const RateFigures&) const = default;
};

// These figures are sums over all measured tissue that relaxes.
struct RelaxationFigures {
  double energy_j = 0;      // elastic, as if nothing had relaxed
  float volume_change = 0;  // of the whole, over its volume without stress
  float relaxed_share =
      0;  // of the stress that there would be at once; over 1 just after a load has gone

  bool operator==(const RelaxationFigures&) const = default;
};

// Why the tissue is moved by the solver that moves it.
enum class SolverReason : std::uint8_t {
  Unknown = 0,
  Idle = 1,
  Fits = 2,
  Frozen = 3,
  Outside = 4,
  Force = 5,
  Cut = 6,
  Error = 7,
  Off = 8,
  Preparing = 9,
};

// In a session with a reduction, this says which solver moves the tissue.
struct SolverFigures {
  bool is_reduced = false;
  std::uint32_t patch_count = 0;           // that act
  std::array<std::uint32_t, 4> patches{};  // of the reduction, from 1
  SolverReason reason = SolverReason::Unknown;
  float estimate = 0;  // of the error in the norm of energy; a force errs by less
  float largest_node_force_n = 0;

  bool operator==(const SolverFigures&) const = default;
};

// The server sends these figures of the full solution that it computes beside a session with a
// reduction.
enum class GhostStatus : std::uint8_t {
  Unknown = 0,  // nothing heard yet
  None = 1,     // the session has no reduction
  Begins = 2,
  Follows = 3,
  Changed = 4,  // the surface has changed: it begins again
  Behind = 5,   // it did not keep up: it begins again
};
struct Ghost {
  GhostStatus status = GhostStatus::Unknown;
  // The rest while it follows.
  std::uint32_t epoch = 0;
  std::vector<Vec3f> offsets;  // m, per vertex: from the session's surface to the full solution
  float largest_m = 0, root_mean_square_m = 0;
  std::uint32_t behind_ms = 0;
};

// The server sends these figures about itself with each frame.
struct FrameFigures {
  std::uint32_t active_nodes = 0, queue_nodes = 0, region_count = 0;
  std::uint32_t sweeps = 0, far_sweeps = 0;  // of active nodes and of all others
  std::uint32_t far_interval = 1;            // ticks for which these far sweeps are
  float residual_n = 0;
  float tick_median_us = 0, tick_p99_us = 0;
  std::vector<float> stage_median_us;  // order of Stage in server/tissue/step
  std::uint64_t slow_ticks = 0;
  std::uint64_t state_hash = 0;
  RateFigures rate;
  std::optional<RelaxationFigures> relaxation;
  std::optional<SolverFigures> solver;
};

// One frame as the server published it.
struct SessionFrame {
  Frame frame = 0;
  Tick tick = 0;
  std::uint64_t arrival_ns = 0;        // monotonic
  wire::QuantisedSurface surface;      // displacements from rest, of every vertex of the topology
  bool has_state = false;              // the rest is valid: its FrameState has arrived
  std::vector<Tool> tools;             // by slot
  std::vector<std::uint16_t> regions;  // per vertex slot: 0 not active, else merged region
  FrameFigures figures;
};

enum class ClaimOutcome : std::uint8_t {
  Granted = 0,
  RefusedHeld = 1,
  RefusedNothingInReach = 2,
  Released = 3,
  TakenOver = 4,
  Expired = 5,
  Slipped = 6,
};
inline bool is_refusal(ClaimOutcome outcome) {
  return outcome == ClaimOutcome::RefusedHeld || outcome == ClaimOutcome::RefusedNothingInReach;
}

struct Notice {
  Tick tick = 0;
  ToolSlot tool;
  tool::Verb verb = tool::Verb::None;
  ClaimOutcome outcome = ClaimOutcome::Granted;
  std::string text;  // one line for the person
  std::uint64_t arrival_ns = 0;
  bool is_for_all = false;  // not of a tool: what the instructor has done
};

}  // namespace trocar::replica
