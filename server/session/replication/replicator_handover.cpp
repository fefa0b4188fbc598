// The replicator's part about instruments that an instructor gives from one hand to another.

#include <algorithm>
#include <utility>

#include "common/base/printable.h"
#include "server/session/replication/replicator_client.h"
#include "server/session/replication/validation.h"

namespace trocar::replication {
namespace {

Error cannot(std::string why) {
  return {ErrorCode::Refused, std::move(why)};
}

const step::ToolFrame* find_tool(const step::SharedFrame& frame, ToolSlot slot) {
  if (!frame) return nullptr;
  const auto tool = std::ranges::find(frame->tools, slot, &step::ToolFrame::tool);
  return tool == frame->tools.end() ? nullptr : &*tool;
}

// A hand that holds or cuts has something to lose.
bool is_free(const step::ToolFrame& tool) {
  return tool.verb != tool::Verb::Grasp && !(tool.verb == tool::Verb::Cut && tool.has_claim);
}

}  // namespace

// Whoever gives may be away: it is what others can do for tissue that nobody's hand holds.
Result<ToolSlot> Replicator::find_receiving_tool(const TeachOrder& order) const {
  const auto* giver = roster_.find(order.participant);
  const auto* receiver = roster_.find(order.receiver);
  if (giver == nullptr || receiver == nullptr || receiver->name != order.receiver_name)
    return cannot(printable(order.receiver_name, 32) + " is not here any more");
  if (giver->slot == receiver->slot) return cannot(giver->name + " has it already");
  for (const auto* who : {giver, receiver})
    if (who->tools.empty()) return cannot(who->name + " has no tools");
  if (static_cast<std::size_t>(order.tool) >= giver->tools.size())
    return cannot(giver->name + " has one tool only");
  if (receiver->is_away) return cannot(receiver->name + " has lost the connection");
  if (!receiver->frozen_by.empty())
    return cannot("the tools of " + receiver->name + " are held still: release them first");
  const auto& frame = encoder_.current();
  if (find_tool(frame, tool_slot(giver->slot, order.tool)) == nullptr)
    return cannot("nobody has seen that instrument of " + giver->name + " yet");
  // The same hand is tried before the other.
  for (const int number : {order.tool, 1 - order.tool}) {
    if (static_cast<std::size_t>(number) >= receiver->tools.size()) continue;
    const auto slot = tool_slot(receiver->slot, number);
    if (const auto* tool = find_tool(frame, slot); tool != nullptr && is_free(*tool)) return slot;
  }
  return cannot(receiver->name + " has no free hand");
}

std::string Replicator::hand_over(const hands::Handover& handover) {
  const auto [from, to] = handover;
  if (!inbox_.try_push_handover(handover)) return "not done: too much is under way, ask again";
  held_tools_.hand_over(handover);
  const auto shape_of = [this](ToolSlot tool) {
    return roster_.find(tool.owner())->tools[static_cast<std::size_t>(tool.number())];
  };
  const auto given = shape_of(from), taken = shape_of(to);
  for (const auto& [tool, shape] : {std::pair{from, taken}, std::pair{to, given}}) {
    (void)roster_.change_tool(tool.owner(), tool.number(), shape);
    if (auto* client = client_of(tool.owner()))
      client->participant->tools[static_cast<std::size_t>(tool.number())] = shape;
  }
  for (const auto tool : {from, to}) note_loan(tool);
  return {};
}

void Replicator::note_loan(ToolSlot tool) {
  roster_.set_lent(tool, held_tools_.is_lent(tool));
  participants_changed_ = true;
}

}  // namespace trocar::replication
