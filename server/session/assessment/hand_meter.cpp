#include "server/session/assessment/hand_meter.h"

#include <algorithm>

namespace trocar::assessment {
void HandMeter::add(ToolSlot tool, const std::string& person, Tick tick, const Vec3d& tip_m,
                    const Vec3d& force_n) {
  auto& record = records_[tool.value];
  if (record.hand.person.empty()) record.hand.person = person;
  record.track.samples.push_back({seconds_of(tick), tip_m, force_n});
}

void HandMeter::note(ToolSlot tool, tool::Verb verb, wire::ClaimOutcome outcome, Tick tick) {
  auto& record = records_[tool.value];
  switch (outcome) {
    case wire::ClaimOutcome::Granted:
      if (verb == tool::Verb::Grasp) ++record.hand.grasps;
      if (verb == tool::Verb::Cut) ++record.hand.cuts;
      if (record.waits_since)
        record.hand.waited_s +=
            seconds_of(std::max(tick, *record.waits_since) - *record.waits_since);
      record.waits_since.reset();
      break;
    case wire::ClaimOutcome::RefusedHeld:
      ++record.hand.refusals;
      if (!record.waits_since) record.waits_since = tick;
      break;
    case wire::ClaimOutcome::RefusedNothingInReach:
      ++record.hand.refusals;
      break;
    case wire::ClaimOutcome::Slipped:
      ++record.hand.losses;
      break;
    default:
      break;
  }
}

void HandMeter::end_waits(std::span<const lesson::Tip> tips, Tick tick) {
  for (auto& [tool, record] : records_) {
    if (!record.waits_since) continue;
    const auto tip = std::ranges::find(tips, ToolSlot{tool}, &lesson::Tip::tool);
    const bool asks =
        tip != tips.end() && (tip->verb == tool::Verb::Grasp || tip->verb == tool::Verb::Cut);
    if (asks) continue;
    record.hand.waited_s += seconds_of(std::max(tick, *record.waits_since) - *record.waits_since);
    record.waits_since.reset();
  }
}

std::vector<Hand> HandMeter::hands() const {
  std::vector<Hand> hands;
  for (const auto& [tool, record] : records_) {
    auto& hand = hands.emplace_back(record.hand);
    hand.tool = ToolSlot{tool};
    hand.skill = lesson::measure_skill(record.track, limit_n);
    // The stage has ended while it waited.
    if (record.waits_since && !record.track.samples.empty())
      hand.waited_s +=
          std::max(0.0, record.track.samples.back().time_s - seconds_of(*record.waits_since));
  }
  return hands;
}

}  // namespace trocar::assessment
