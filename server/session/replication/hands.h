#pragma once

// Hands say where their tools are, change instruments, and report what was felt.

#include "server/session/participants/held_tools.h"
#include "server/session/replication/audience.h"

namespace trocar::proto {
class HandReport;
class ToolChange;
class ToolSample;
}  // namespace trocar::proto

namespace trocar::replication {

class Hands {
 public:
  Hands(SessionContext& session, ReplicatorCounters& counters)
      : session_(session), counters_(counters) {}

  // `is_ordered`: it came by the stream alone, so that sequence numbers must grow.
  std::optional<Ending> sample(Speaker& who, const proto::ToolSample& sample, bool is_ordered);
  std::optional<Ending> report(Speaker& who, const proto::HandReport& message);
  std::optional<Ending> change_tool(Speaker& who, const proto::ToolChange& change);

  // Opens the jaws of all tools of a hand.
  void open(ParticipantSlot slot);
  // Two tools change hands; returns why not, or nothing.
  std::string hand_over(const hands::Handover& handover);
  participants::HeldTools& held() { return held_; }

 private:
  // Everybody is told whether the tool moves beside its hand's place.
  void note_loan(ToolSlot tool);

  SessionContext& session_;
  ReplicatorCounters& counters_;
  participants::HeldTools held_;
};

}  // namespace trocar::replication
