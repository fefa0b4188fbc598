#pragma once

// Collects what each tool did, over a stage or a session. One thread.

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/wire/claim_outcome.h"
#include "server/session/assessment/assessment.h"

namespace trocar::assessment {

class HandMeter {
 public:
  double limit_n = 2;  // of the time with too much force

  // In order of ticks; `force_n`: of the tissue on the tool.
  void add(ToolSlot tool, const std::string& person, Tick tick, const Vec3d& tip_m,
           const Vec3d& force_n);
  // Says what became of a grasp or cut that the tool asked for.
  void note(ToolSlot tool, tool::Verb verb, wire::ClaimOutcome outcome, Tick tick);
  // A tool that asks no more does not wait any more. `tips`: of the frame.
  void end_waits(std::span<const lesson::Tip> tips, Tick tick);

  // By tool.
  std::vector<Hand> hands() const;

 private:
  struct Record {
    Hand hand;
    lesson::Track track;
    std::optional<Tick> waits_since;
  };
  std::map<std::uint8_t, Record> records_;
};

}  // namespace trocar::assessment
