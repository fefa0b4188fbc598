#pragma once

// A tick takes these from outside. A TickInputs is all that the network, scripts or a journal can
// say to the simulation; with TickDecisions it determines the next state to the bit.

#include <array>
#include <optional>
#include <vector>

#include "common/base/ids.h"
#include "common/tool/tool.h"

namespace trocar::hands {

struct HandJoin {
  ParticipantSlot slot;  // has_tools()
  int tool_count = 1;    // 1 or 2
  std::array<tool::ToolShape, kToolsPerHand> shapes;
};

// A hand takes another instrument.
struct ToolChange {
  ToolSlot tool;
  tool::ToolShape shape;
};

// Two hands change instruments as they are: each goes on, where it is, with what it holds, as that
// of the other hand. A blade is lifted.
struct Handover {
  ToolSlot from, to;  // of two participants
};

// An instructor may do this to the organ as a whole.
enum class MarkAction : std::uint8_t {
  None = 0,
  Set = 1,     // marks it as it is, instead of the mark before
  Return = 2,  // makes it what it was when it was marked
};

// This many marks stand side by side.
inline constexpr std::uint8_t kMostMarks = 4;

struct ToolInput {
  ToolSlot tool;
  tool::ToolSample sample;
  std::uint64_t client_time_us = 0;  // see hands::Tool; not recorded
};

// Admitted in this order: mark, handover, leaves, joins, changes, samples. Several samples of one
// tool: the last one counts. Everything is validated before (server/session/replication); the tick
// drops what does not fit its state, such as a sample for an empty slot, and counts it.
struct TickInputs {
  MarkAction mark = MarkAction::None;
  std::uint8_t mark_number = 0;  // less than kMostMarks
  std::optional<Handover> handover;
  std::vector<ParticipantSlot> leaves;
  std::vector<HandJoin> joins;
  std::vector<ToolChange> changes;
  std::vector<ToolInput> samples;

  bool empty() const {
    return mark == MarkAction::None && !handover && leaves.empty() && joins.empty() &&
           changes.empty() && samples.empty();
  }
  void clear() {
    mark = MarkAction::None;
    mark_number = 0;
    handover.reset();
    leaves.clear();
    joins.clear();
    changes.clear();
    samples.clear();
  }
};

}  // namespace trocar::hands
