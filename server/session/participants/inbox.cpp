#include "server/session/participants/inbox.h"

#include <algorithm>
#include <utility>

#include "common/base/assert.h"

namespace trocar::participants {

void SimulationInbox::push(Item item) {
  pending_.fetch_add(1, std::memory_order_relaxed);
  const bool fits = queue_.try_push(std::move(item));
  TROCAR_ASSERT(fits);
}

bool SimulationInbox::try_push_join(const hands::HandJoin& join) {
  TROCAR_ASSERT(join.slot.has_tools());
  const std::size_t leaves = joined_hands_ + 1;
  if (pending_.load(std::memory_order_acquire) + 1 + leaves > kCapacity) return false;
  push(join);
  ++joined_hands_;
  return true;
}

void SimulationInbox::push_leave(ParticipantSlot slot) {
  TROCAR_ASSERT(slot.has_tools() && joined_hands_ > 0);
  push(slot);
  --joined_hands_;
}

bool SimulationInbox::try_push_change(const hands::ToolChange& change) {
  TROCAR_ASSERT(change.tool.is_valid());
  if (pending_.load(std::memory_order_acquire) >= kCapacity - kReservedForJoins) return false;
  push(change);
  return true;
}

bool SimulationInbox::try_push_handover(const hands::Handover& handover) {
  TROCAR_ASSERT(handover.from.is_valid() && handover.to.is_valid());
  if (pending_.load(std::memory_order_acquire) >= kCapacity - kReservedForJoins) return false;
  push(handover);
  return true;
}

void SimulationInbox::push_sample(const hands::ToolInput& input) {
  TROCAR_ASSERT(input.tool.is_valid());
  if (pending_.load(std::memory_order_acquire) >= kCapacity - kReservedForJoins) {
    ++counters_.samples_dropped;
    return;
  }
  push(input);
  ++counters_.samples_taken;
}

void SimulationInbox::drain(hands::TickInputs& inputs) {
  gather();
  inputs.clear();
  const auto mark = mark_.exchange(Mark{}, std::memory_order_relaxed);
  inputs.mark = mark.action;
  inputs.mark_number = mark.number;
  inputs.handover = std::exchange(handover_, {});
  for (std::uint8_t slot = 0; slot < kMaxHands; ++slot) {
    auto& change = changes_[slot];
    if (change.leaves) inputs.leaves.push_back({slot});
    if (change.join) inputs.joins.push_back(*change.join);
    change = {};
  }
  for (std::uint8_t tool = 0; tool < kMaxTools; ++tool) {
    if (tool_changes_[tool]) inputs.changes.push_back(*tool_changes_[tool]);
    tool_changes_[tool].reset();
    if (samples_[tool]) inputs.samples.push_back(*samples_[tool]);
    samples_[tool].reset();
  }
}

bool SimulationInbox::is_fresh() const {
  const auto is_set = [](const auto& entry) { return entry.has_value(); };
  return !handover_ && std::ranges::none_of(tool_changes_, is_set) &&
         std::ranges::none_of(samples_, is_set) &&
         std::ranges::none_of(changes_, [](const auto& slot) { return slot.leaves || slot.join; });
}

void SimulationInbox::gather() {
  if (next_handover_) {
    if (!is_fresh()) return;
    handover_ = std::exchange(next_handover_, {});
  }
  for (std::size_t taken = 0; taken < kCapacity; ++taken) {
    const auto item = queue_.try_pop();
    if (!item) break;
    // After the pop, so that a producer who sees room has it.
    pending_.fetch_sub(1, std::memory_order_release);
    if (const auto* slot = std::get_if<ParticipantSlot>(&*item)) {
      auto& change = changes_[slot->value];
      // A tenant who came and went within one tick was never there.
      if (change.join)
        change.join.reset();
      else
        change.leaves = true;
      for (int number = 0; number < kToolsPerHand; ++number) {
        const auto tool = tool_slot(*slot, number).value;
        tool_changes_[tool].reset();
        samples_[tool].reset();
      }
    } else if (const auto* handover = std::get_if<hands::Handover>(&*item)) {
      (is_fresh() ? handover_ : next_handover_) = *handover;
      if (next_handover_) break;
    } else if (const auto* join = std::get_if<hands::HandJoin>(&*item)) {
      changes_[join->slot.value].join = *join;
    } else if (const auto* tool = std::get_if<hands::ToolChange>(&*item)) {
      tool_changes_[tool->tool.value] = *tool;
      samples_[tool->tool.value].reset();
    } else if (const auto* input = std::get_if<hands::ToolInput>(&*item)) {
      samples_[input->tool.value] = *input;
    }
  }
}

}  // namespace trocar::participants
