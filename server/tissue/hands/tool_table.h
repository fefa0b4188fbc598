#pragma once

// The tools in the session as the simulation knows them. Samples arrive at about 125 Hz, ticks run
// at 1 kHz: each tool latches its newest sample and moves to it in equal steps, so that tissue
// meets a moving tool and not a jumping one. Verbs change at once.

#include <array>

#include "common/base/ids.h"
#include "common/base/tick.h"
#include "common/math/frame.h"
#include "common/tool/tool.h"
#include "server/tissue/hands/inputs.h"
#include "server/tissue/world/state_archive.h"

namespace trocar::hands {

// Ticks in which a tool reaches a new sample: a little over the 8 ms between samples, so that
// jitter leaves no stand-still.
inline constexpr std::uint32_t kPoseTicks = 10;

struct Tool {
  bool is_present = false;
  bool has_sample = false;  // until the first sample the tool touches nothing
  tool::ToolShape shape;
  tool::Verb verb = tool::Verb::None;
  Pose pose;                     // world_from_tool, this tick
  Pose target;                   // of the newest sample
  std::uint32_t steps_left = 0;  // until pose reaches target
  Tick last_sample_tick = 0;
  float closed = 0;  // scissors: 0 open, 1 closed
  // The client's clock at `pose` and at `target`; 0: it does not say. Not state: nothing but the
  // client's own hand depends on it.
  std::uint64_t time_us = 0, target_time_us = 0;
};

// Returns where the edge of a tool that cuts is, m, world frame: its tip first, where it has one.
// Scissors cut where their blades meet, across, as wide as they are open at the tip's side of that.
std::array<Vec3f, 2> edge_of(const Tool& tool);
// Returns what of a tool that cuts claims tissue, from its tip on, m: an edge, or blades' length.
Vec3f cut_line_of(const Tool& tool);
// Scissors that have closed cut no more until they have opened.
inline bool can_cut(const Tool& tool) {
  return tool.shape.form != tool::Form::Scissors || tool.closed < 1;
}
// Opened blades of scissors are this far apart at their tips, as a part of their length.
inline constexpr float kScissorsOpening = 0.5f;
// Ticks in which they close, and in which they open.
inline constexpr float kScissorsCloseTicks = 300, kScissorsOpenTicks = 150;

class ToolTable {
 public:
  const Tool& operator[](ToolSlot slot) const { return tools_[slot.value]; }

  // Admits a tick's inputs, then moves every tool one step. Returns how many inputs did not fit the
  // state (an empty slot, a taken one) and were dropped.
  std::uint32_t admit(const hands::TickInputs& inputs, Tick tick);

  // Before the tick's other inputs: two present tools of two hands change their places as they are,
  // but for blades, which are lifted. False: they are not such, and nothing has changed.
  bool hand_over(const hands::Handover& handover, Tick tick);

  void visit_state(world::StateArchive& archive);

 private:
  bool admit_join(const hands::HandJoin& join, Tick tick);
  bool admit_change(const hands::ToolChange& change, Tick tick);
  bool admit_sample(const hands::ToolInput& input, Tick tick);

  std::array<Tool, kMaxTools> tools_;
};

}  // namespace trocar::hands
