#pragma once

// A published frame leaves the simulation every 16th tick: one immutable object, shared by the
// replication strand and the journal. Nobody outside the simulation thread sees anything else of
// its state.

#include <memory>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/ids.h"
#include "common/base/tick.h"
#include "common/tool/tool.h"
#include "common/wire/blood_codec.h"
#include "common/wire/figures.h"
#include "common/wire/haptic_patch.h"
#include "common/wire/quantise.h"
#include "common/wire/surface_change.h"
#include "server/tissue/hands/claims.h"
#include "server/tissue/hands/inputs.h"
#include "server/tissue/step/tick_report.h"

namespace trocar::step {

struct ToolFrame {
  ToolSlot tool;
  Pose world_from_tool;
  Pose world_from_proxy;  // where the tissue lets it be
  tool::Verb verb = tool::Verb::None;
  Vec3f force_n, torque_nm;  // of the tissue on the tool, world frame; torque about the tip
  std::uint32_t contact_nodes = 0;
  float penetration_m = 0;  // deepest contact, >= 0
  bool has_claim = false;   // its push or grasp is in effect
  bool is_inside = false;   // appeared inside tissue: touches nothing until it has come out
  bool is_silent = false;   // lease no longer fresh
  // For the client whose hand feels it; of kind Free where none does. Not simulation.
  wire::HapticPatch touch;
};

// A mark event says what became of an instructor's request.
struct MarkEvent {
  Tick tick = 0;
  hands::MarkAction action = hands::MarkAction::None;
  bool is_done = false;     // false: there is no mark to return to
  std::uint8_t number = 0;  // of the mark
};

// The journal needs this record to simulate one tick again.
struct TickRecord {
  Tick tick = 0;
  TickDecisions decisions;
  hands::TickInputs inputs;
  std::uint64_t state_hash = 0;  // after the tick
};

struct PublishedFrame {
  Frame frame = 0;
  Tick tick = 0;
  std::uint32_t epoch = 0;  // after `change`
  // The surface has changed by this since the frame before; null: it has not.
  std::shared_ptr<const wire::SurfaceChange> change;
  // Another surface than that of the frame before, from which no change leads to it; null: none.
  std::shared_ptr<const wire::SurfaceLayout> new_layout;
  wire::QuantisedSurface surface;  // displacements from rest, per vertex slot
  std::uint32_t surface_crc = 0;
  // It has a level per slot where the session bleeds (common/wire/blood_codec.h), and else none.
  wire::BloodLevels blood;
  std::uint32_t blood_crc = 0;
  Bytes threads;  // where surgical thread is (common/wire/thread_codec.h); empty: there is none
  std::vector<std::uint16_t>
      regions;                   // per vertex slot: 0 not active, else merged region 1, 2, ...
  std::vector<ToolFrame> tools;  // occupied tools, by slot
  std::vector<hands::ClaimEvent> claim_events;  // of the ticks since the frame before
  std::vector<MarkEvent> mark_events;           // likewise
  std::vector<TickRecord> records;              // of the ticks since the frame before
  // Full state after `snapshot_tick`, at the start and every 10 s, else null. Taken
  // between publications: publishing changes the quantisation's hysteresis after the tick's hash.
  std::shared_ptr<const Bytes> snapshot;
  Tick snapshot_tick = 0;
  wire::FrameFigures figures;  // of the frame's tick
};

using SharedFrame = std::shared_ptr<const PublishedFrame>;

}  // namespace trocar::step
