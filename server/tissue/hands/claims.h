#pragma once

// Claims: who may act on which nodes. A claim is a lease in ticks on a core of nodes: exclusive for
// a grasp and for a cut, shared for a push. The core of a grasp stays, that of a cut is what is
// near the blade: it is asked for in every tick, and the blade stops where it meets what another
// holds. Requests are decided together at the end of a tick and valid from the next, in the order
// (tick of the first refusal, tool slot), so arrival order inside a tick cannot matter. All of the
// core or nothing; no hold and wait, so no deadlock.
//
// Life of a grasp:  wanted -> (refused, retried while the verb is held)* -> held -> released, or
// slipped off.
// A silent holder (no sample for 250 ticks) keeps its grasp, but others may take the core over;
// then its force ramps to zero in 100 ticks. If nobody does, it is held for 2,000 ticks and then
// ramped down over 500. A holder that leaves frees its core at once.

#include <array>
#include <span>
#include <vector>

#include "common/base/ids.h"
#include "common/base/index.h"
#include "common/base/tick.h"
#include "common/tool/tool.h"
#include "common/wire/claim_outcome.h"
#include "server/tissue/world/state_archive.h"

namespace trocar::hands {

inline constexpr Tick kLeaseTicks = 250;     // without a sample: others may take the core
inline constexpr Tick kAbandonTicks = 2000;  // without a sample: the grasp starts to ramp down
inline constexpr Tick kAbandonRampTicks = 500;
inline constexpr Tick kTakeoverRampTicks = 100;  // also when the holder leaves

using wire::ClaimOutcome;

struct ClaimEvent {
  Tick tick = 0;
  ToolSlot tool;
  tool::Verb verb = tool::Verb::None;
  ClaimOutcome outcome = ClaimOutcome::Granted;
  ToolSlot holder;  // RefusedHeld: who holds it; TakenOver: who took it; else invalid
};

// Jaws have this of surgical thread, whose own rules say which stretch each tool holds
// (server/tissue/thread/grips.h). Jaws with thread between them hold no tissue.
struct ThreadGrip {
  bool is_held = false;
  ToolSlot holder;  // who holds the thread that these jaws closed on in vain; invalid: nobody
};

// A tool asks for this at the end of a tick.
struct ClaimRequest {
  ToolSlot tool;
  tool::Verb verb = tool::Verb::None;
  Tick last_sample_tick = 0;
  std::span<const NodeIndex> core;  // of a grasp, a cut: the nodes in reach, ascending
  ThreadGrip thread;
};

enum class ClaimPhase : std::uint8_t {
  None = 0,
  Wanted = 1,   // refused, and retried while the verb is held
  Held = 2,     // in effect from the tick after the grant
  Ramping = 3,  // taken over, left or abandoned: core is free, force fades out
  Spent = 4,    // slipped off: takes no hold until the verb ends, as jaws must open first
};

struct Claim {
  ClaimPhase phase = ClaimPhase::None;
  tool::Verb verb = tool::Verb::None;
  ClaimOutcome last_refusal = ClaimOutcome::Granted;  // Granted: not refused yet
  ToolSlot last_holder;
  Tick first_refusal_tick = 0;  // phase Wanted
  Tick ramp_start_tick = 0;     // phase Ramping
  std::uint32_t ramp_ticks = 0;
};

class ClaimTable {
 public:
  explicit ClaimTable(std::size_t node_count);

  // The tool whose grasp or cut holds the node exclusively; invalid if none.
  ToolSlot owner(NodeIndex node) const { return owners_[node.value]; }
  const Claim& claim(ToolSlot tool) const { return claims_[tool.value]; }
  // In effect this tick: granted in an earlier one.
  bool is_in_effect(ToolSlot tool) const {
    return claim(tool).phase == ClaimPhase::Held || claim(tool).phase == ClaimPhase::Ramping;
  }
  // 1 while held, then down to 0 along the ramp: scales the force of the claim's verb.
  float strength(ToolSlot tool, Tick tick) const;

  // A node that is a copy of another, or between two: held by whoever holds both.
  void add_node(NodeIndex a, NodeIndex b) {
    const auto holder = owners_[a.value];
    owners_.push_back(holder == owners_[b.value] ? holder : ToolSlot{});
  }

  // A hand left: its grasps free their core now and fade out; its other claims end.
  void leave(ToolSlot tool, Tick tick);

  // Two tools have changed hands: grasps and pushes go with them, cuts end. What each holds is told
  // as the new hand's.
  void hand_over(ToolSlot from, ToolSlot to, Tick tick, std::vector<ClaimEvent>& events);

  // A grasp lost one of its nodes, or the last of them.
  void release_node(ToolSlot tool, NodeIndex node);
  void slip_off(ToolSlot tool, Tick tick, std::vector<ClaimEvent>& events);

  // Decides all requests (ascending tool slots, occupied tools only) at the end of `tick`. Appends
  // to `events` what a person should hear of, once per change, not once per retry.
  void update(Tick tick, std::span<const ClaimRequest> requests, std::vector<ClaimEvent>& events);

  // For another state of the tissue, whose nodes nobody holds: who held something in `before` opens
  // his jaws, or lifts his blade, first.
  void let_go(const ClaimTable& before);

  void visit_state(world::StateArchive& archive);

 private:
  void release_core(ToolSlot tool);
  void start_ramp(ToolSlot tool, Tick tick, Tick ramp_ticks);
  // Who holds a node of the core and has not fallen silent; invalid: nobody.
  ToolSlot holder_of(Tick tick, const ClaimRequest& request,
                     std::span<const ClaimRequest> requests) const;
  void take_over(Tick tick, const ClaimRequest& request, std::vector<ClaimEvent>& events);
  // Tells of it when it is another than the last.
  void refuse(Tick tick, const ClaimRequest& request, ClaimOutcome outcome, ToolSlot holder,
              std::vector<ClaimEvent>& events);
  void decide_cut(Tick tick, const ClaimRequest& request, std::span<const ClaimRequest> requests,
                  std::vector<ClaimEvent>& events);
  void decide_grasp(Tick tick, const ClaimRequest& request, std::span<const ClaimRequest> requests,
                    std::vector<ClaimEvent>& events);

  std::vector<ToolSlot> owners_;  // per node
  std::array<Claim, kMaxTools> claims_;
  std::vector<const ClaimRequest*> waiting_;  // scratch
};

}  // namespace trocar::hands
