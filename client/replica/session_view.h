#pragma once

// A client keeps what it knows of the session in these plain types: nothing above the replica sees
// a Protobuf message. Metres, world frame.

#include <array>
#include <string>
#include <vector>

#include "common/base/ids.h"
#include "common/base/tick.h"
#include "common/tool/tool.h"
#include "common/wire/blood_codec.h"
#include "common/wire/claim_outcome.h"
#include "common/wire/figures.h"
#include "common/wire/quantise.h"
#include "common/wire/role.h"
#include "common/wire/thread_codec.h"

namespace trocar::replica {

using wire::ClaimOutcome;
using wire::has_tools;
using wire::is_refusal;
using wire::name_of;
using wire::Role;

struct Participant {
  ParticipantSlot slot;
  std::string name;
  Role role = Role::Unknown;
  std::vector<tool::ToolShape> tools;
  bool is_away = false;          // the connection is lost, the place is kept
  std::string frozen_by;         // who keeps the tools where they are; empty: nobody
  std::uint32_t lent_tools = 0;  // a bit each: handed over, it moves beside its hand's place
  bool leads_view = false;       // the view to follow is this one's
  std::uint32_t relayed = 0;     // so many more watch through this one
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

// One frame as the server published it.
struct SessionFrame {
  Frame frame = 0;
  Tick tick = 0;
  std::uint64_t arrival_ns = 0;        // monotonic
  std::uint64_t server_time_us = 0;    // when the server published it, by its clock; 0: unknown
  wire::QuantisedSurface surface;      // displacements from rest, of every vertex of the topology
  wire::BloodLevels blood;             // of every vertex; empty: the session does not bleed
  bool has_state = false;              // the rest is valid: its FrameState has arrived
  std::vector<Tool> tools;             // by slot
  std::vector<std::uint16_t> regions;  // per vertex slot: 0 not active, else merged region
  wire::ThreadPicture threads;         // empty: there is none
  wire::FrameFigures figures;
};

// A place that a participant shows to everybody.
struct Pointer {
  ParticipantSlot participant;
  Vec3f position_m;
  std::uint64_t arrival_ns = 0;
};

// A line that somebody has drawn, by where its points are on the surface at rest.
struct Stroke {
  ParticipantSlot participant;
  std::vector<Vec3f> rest_m;
};

// The stage of the session's lesson.
struct LessonResult {
  std::string name;
  bool is_reached = false;
  float seconds = 0, points = 0;
  std::vector<std::string> lines;  // what was measured
};
struct LessonView {
  enum class Goal : std::uint8_t { Other = 0, Find = 1, Follow = 2, Incise = 5, Carry = 7 };
  std::string title, name, text, hint;  // hint: empty until it is time
  std::uint32_t stage = 0, stages = 0;  // from 0
  Goal goal = Goal::Other;
  Tick begin_tick = 0;
  float limit_s = 0, force_limit_n = 0;
  std::vector<Vec3f> line_m;
  float lap_s = 0, tolerance_m = 0;
  std::string picture;                // an image file; empty: none
  std::vector<LessonResult> results;  // of stages that are over
  bool is_over = false;
  float points = 0;
  // Told more often.
  float progress = 0, seconds = 0;
  bool is_too_strong = false;

  // Returns where the point to follow is, or a piece has to be; nothing: there is none.
  std::optional<Vec3f> target_m(Tick now) const;
};

// How fast time goes in the session.
struct SessionPace {
  float rate = 1;  // simulated time over real time
  bool is_paused = false;
  std::string by;  // who decided so last; empty: nobody
};

// The view of who was given it.
struct LedView {
  ParticipantSlot participant;
  Vec3f eye_m, target_m;
  std::uint64_t arrival_ns = 0;
};

struct Notice {
  Tick tick = 0;
  ToolSlot tool;
  tool::Verb verb = tool::Verb::None;
  ClaimOutcome outcome = ClaimOutcome::Granted;
  std::string holder;  // the name of who holds the tissue; empty: nobody
  std::string text;    // one line for the person
  std::uint64_t arrival_ns = 0;
  bool is_for_all = false;  // not of a tool: what the instructor or the lesson has done
  bool is_refused = false;  // likewise: it was not done
};

}  // namespace trocar::replica
