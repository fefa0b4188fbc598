#pragma once

// An instructor holds tools of others still, opens their jaws, or gives what one hand has to
// another: this stands between the samples of hands and the simulation.
//
//   free --freeze--> frozen: last pose and verb, whatever the hand does
//   frozen --release--> returning: to the hand, at most at kReturnSpeed and kReturnTurn --> free
//   any --open--> jaws are open and the blade is up, until the hand's own verb has ended
//
//   any --hand over, it grasps--> lent: moves from where it is as its new hand moves from where
//   that
//                                 is, and goes on grasping --the hand grasps, then opens-->
//                                 returning
//   any --hand over--> returning, open until the hand's own verb has ended
//
// A tool that returns holds what it held if its hand does, too; it neither pushes nor cuts on the
// way. A hand that grasps when it gets an instrument has to open first, so that it does not open
// what it has not closed. Until a tool is back, or while it is lent, its samples carry no time of
// the client's clock: so the hand feels nothing, and its safeguards fade the force out and in
// again.
//
// The simulation, and so the recording, gets what comes out of here, and nothing else of the hand.
// Thread: the I/O thread.

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "server/tissue/hands/inputs.h"

namespace trocar::participants {

inline constexpr float kReturnSpeed = 0.15f;  // m/s, of the tip
inline constexpr float kReturnTurn = 2.0f;    // rad/s

class HeldTools {
 public:
  // Returns what the simulation gets in place of a sample; nothing: the tool is frozen, and is
  // nowhere yet.
  std::optional<hands::ToolInput> apply(const hands::ToolInput& wanted, std::uint64_t now_ns);

  void freeze(ParticipantSlot slot);
  void release(ParticipantSlot slot);
  bool is_frozen(ParticipantSlot slot) const { return slot.has_tools() && is_frozen_[slot.value]; }
  // Returns what the simulation gets at once: hands that are silent have to let go, too.
  std::vector<hands::ToolInput> open(ParticipantSlot slot);
  // Two tools have changed hands. Nothing is given to the simulation: it changes them itself.
  void hand_over(const hands::Handover& handover);
  // The tool moves beside its hand's place, and goes on grasping until the hand has grasped.
  bool is_lent(ToolSlot tool) const { return tools_[tool.value].loan.has_value(); }
  // The place is free.
  void forget(ParticipantSlot slot);

 private:
  struct Loan {
    enum class Stage : std::uint8_t { HandMayGrasp, HandIsOpen, HandGrasps };

    std::optional<Pose> hand;  // at its newest sample; nothing: it has given none
    Stage stage = Stage::HandMayGrasp;
  };
  struct Tool {
    std::optional<tool::ToolSample> last;  // that the simulation was given
    std::uint64_t last_ns = 0;
    bool is_returning = false;
    bool is_opened = false;  // until the hand's own verb ends
    std::optional<Loan> loan;
  };

  static void apply_loan(const tool::ToolSample& wanted, Tool& tool, hands::ToolInput& given);

  std::array<Tool, kMaxTools> tools_;
  std::array<bool, kMaxHands> is_frozen_{};
};

}  // namespace trocar::participants
