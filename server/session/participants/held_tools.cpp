#include "server/session/participants/held_tools.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace trocar::participants {
namespace {

using tool::ToolSample;
using tool::Verb;

// A hand says at least this often where it is; after a longer silence a tool gets no farther.
constexpr float kLongestStep_s = 0.05f;

float angle_between(const Quatf& a, const Quatf& b) {
  const float dot = std::abs(a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w);
  return 2 * std::acos(std::min(dot, 1.0f));
}

// The pose on the way from `from` to `to` after `seconds`; `to` itself once it is in reach.
Pose step_towards(const Pose& from, const Pose& to, float seconds) {
  const float way = length(to.position - from.position);
  const float turn = angle_between(from.orientation, to.orientation);
  const float least = 1e-9f;
  const float share = std::min(kReturnSpeed * seconds / std::max(way, least),
                               kReturnTurn * seconds / std::max(turn, least));
  if (share >= 1) return to;
  return {from.position + (to.position - from.position) * share,
          interpolate(from.orientation, to.orientation, share)};
}

}  // namespace

std::optional<hands::ToolInput> HeldTools::apply(const hands::ToolInput& wanted,
                                                 std::uint64_t now_ns) {
  auto& tool = tools_[wanted.tool.value];
  const float seconds = std::min(static_cast<float>(now_ns - tool.last_ns) * 1e-9f, kLongestStep_s);
  tool.last_ns = now_ns;
  if (wanted.sample.verb == Verb::None) tool.is_opened = false;
  auto given = wanted;
  if (is_frozen(wanted.tool.owner())) {
    if (!tool.last) return std::nullopt;
    given.sample = *tool.last;
    given.client_time_us = 0;
  } else if (tool.loan) {
    apply_loan(wanted.sample, tool, given);
  } else if (tool.is_returning) {
    given.sample.world_from_tool =
        step_towards(tool.last->world_from_tool, wanted.sample.world_from_tool, seconds);
    tool.is_returning = given.sample.world_from_tool != wanted.sample.world_from_tool;
    const bool still_holds = tool.last->verb == Verb::Grasp && wanted.sample.verb == Verb::Grasp;
    if (tool.is_returning) {
      given.client_time_us = 0;
      given.sample.verb = still_holds ? Verb::Grasp : Verb::None;
    }
  }
  if (tool.is_opened) given.sample.verb = Verb::None;
  tool.last = given.sample;
  return given;
}

// A hand that jumps, as a pointer does that comes back from elsewhere, takes nothing along. A tool
// whose hand would move it out of the session's room stays where it is.
void HeldTools::apply_loan(const ToolSample& wanted, Tool& tool, hands::ToolInput& given) {
  constexpr float kRoom_m = 2, kJump_m = 0.05f;
  auto& loan = *tool.loan;
  const Pose& hand = wanted.world_from_tool;
  const bool grasps = wanted.verb == Verb::Grasp;
  Pose pose = tool.last->world_from_tool;
  if (loan.hand) {
    const Vec3f way = hand.position - loan.hand->position, moved = pose.position + way;
    if (length_squared(way) < kJump_m * kJump_m && length_squared(moved) < kRoom_m * kRoom_m)
      pose = {moved,
              normalized(hand.orientation * conjugate(loan.hand->orientation) * pose.orientation)};
  }
  loan.hand = hand;
  given.client_time_us = 0;
  given.sample = {.world_from_tool = pose, .verb = Verb::Grasp};
  if (loan.stage == Loan::Stage::HandGrasps && !grasps) {
    given.sample.verb = Verb::None;
    tool.loan.reset();
    tool.is_returning = true;
  } else if (loan.stage == Loan::Stage::HandMayGrasp && !grasps) {
    loan.stage = Loan::Stage::HandIsOpen;
  } else if (loan.stage == Loan::Stage::HandIsOpen && grasps) {
    loan.stage = Loan::Stage::HandGrasps;
  }
}

void HeldTools::hand_over(const hands::Handover& handover) {
  std::swap(tools_[handover.from.value], tools_[handover.to.value]);
  for (const auto slot : {handover.from, handover.to}) {
    auto& tool = tools_[slot.value];
    tool.loan.reset();
    tool.is_returning = tool.last.has_value();
    tool.is_opened = true;
    if (!tool.last) continue;
    if (tool.last->verb == Verb::Cut) tool.last->verb = Verb::None;
    if (slot != handover.to || tool.last->verb != Verb::Grasp) continue;
    tool.is_returning = tool.is_opened = false;
    tool.loan = Loan{};
  }
}

void HeldTools::freeze(ParticipantSlot slot) {
  if (slot.has_tools()) is_frozen_[slot.value] = true;
}

void HeldTools::release(ParticipantSlot slot) {
  if (!is_frozen(slot)) return;
  is_frozen_[slot.value] = false;
  for (int number = 0; number < kToolsPerHand; ++number) {
    auto& tool = tools_[tool_slot(slot, number).value];
    if (tool.loan)  // It goes on from where it was held still.
      tool.loan->hand.reset();
    else
      tool.is_returning = tool.last.has_value();
  }
}

std::vector<hands::ToolInput> HeldTools::open(ParticipantSlot slot) {
  std::vector<hands::ToolInput> inputs;
  for (int number = 0; slot.has_tools() && number < kToolsPerHand; ++number) {
    auto& tool = tools_[tool_slot(slot, number).value];
    if (!tool.last) continue;
    tool.is_opened = true;
    if (tool.loan) tool.is_returning = true;
    tool.loan.reset();
    tool.last->verb = Verb::None;
    inputs.push_back({tool_slot(slot, number), *tool.last, 0});
  }
  return inputs;
}

void HeldTools::forget(ParticipantSlot slot) {
  if (!slot.has_tools()) return;
  is_frozen_[slot.value] = false;
  for (int number = 0; number < kToolsPerHand; ++number) tools_[tool_slot(slot, number).value] = {};
}

}  // namespace trocar::participants
