#include "server/session/replication/teaching.h"

#include <algorithm>
#include <cstdio>

#include "common/base/log.h"
#include "common/base/printable.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"

namespace trocar::replication {
namespace {

// Makes the line that everybody reads. `who`: whom it is about, where it is about one.
std::string words_of(const TeachOrder& order, const std::string& by, const std::string& who) {
  switch (order.action) {
    case TeachAction::Freeze:
      return by + " keeps the tools of " + who + " where they are";
    case TeachAction::Release:
      return by + " has released the tools of " + who;
    case TeachAction::TakeClaim:
      return by + " has taken away what " + who + " holds: let go, then ask for it again";
    case TeachAction::Expel:
      return by + " has put " + who + " out: " + order.text;
    case TeachAction::Rename:
      return by + " has renamed " + who + " to " + order.text;
    case TeachAction::Admit:
      return by + " lets " + order.text + " in";
    case TeachAction::Close:
      return by + " has closed the session to newcomers";
    case TeachAction::Open:
      return by + " has opened the session to newcomers";
    case TeachAction::End:
      return by + " has ended the session";
    case TeachAction::Note:
      return "note by " + by + ": " + order.text;
    case TeachAction::Chat:
      return by + ": " + order.text;
    case TeachAction::GiveView:
      return by + " gives the view to " + who;
    case TeachAction::EndView:
      return by + " has ended the view to follow";
    case TeachAction::Wipe:
      return by + " has wiped the drawing";
    case TeachAction::Pause:
      return by + " has paused the session";
    case TeachAction::GoOn:
      return by + " lets the session go on";
    case TeachAction::Slow: {
      char share[32];
      std::snprintf(share, sizeof share, "%.0f %%", 100 * static_cast<double>(order.rate));
      return order.rate < 1 ? by + " has slowed time down to " + share
                            : by + " lets time go as fast as it does";
    }
    case TeachAction::HandOver:
      return (order.receiver_name == by
                  ? by + " takes over an instrument of " + who
                  : by + " hands an instrument of " + who + " to " + order.receiver_name) +
             ": what grasps goes on grasping, and moves with the hand of " + order.receiver_name +
             ", who opens it by closing once";
    case TeachAction::None:
      break;
  }
  return {};
}

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

std::optional<Ending> Teaching::order(Speaker& who, const proto::TeachRequest& request) {
  const auto order = check_teach(request);
  if (!order) return Ending{EndReason::ProtocolError, order.error().message};
  const auto role = who.participant->role;
  const bool is_chat = order->action == TeachAction::Chat;
  if (!is_chat && !wire::rights_of(role).may_teach)
    return Ending{EndReason::Role, std::string("TeachRequest: \"") + name_of(order->action) +
                                       "\" is the instructor's, not of " + wire::one_of(role)};
  const auto slot = who.participant->slot;
  const auto refuse = [&](const std::string& why) {
    proto::Envelope answer;
    describe(*order, slot, false, why, *answer.mutable_teach_event());
    session_.audience.send(who, wire::encode_envelope(answer));
    return std::nullopt;
  };
  if (!who.sayings.take(is_chat ? 1 : 0.25, session_.now_ns()))
    return refuse("not done: at most one line a second, or four other requests");
  const auto* whom = session_.roster.find(order->participant);
  if (is_about_one(order->action) && (whom == nullptr || whom->name != order->name))
    return refuse("not done: " + printable(order->name, 32) + " is not here any more");
  std::optional<ToolSlot> received;
  if (order->action == TeachAction::HandOver) {
    auto found = find_receiving_tool(*order);
    if (!found) return refuse("not done: " + found.error().message);
    received = *found;
  }
  const auto words =
      words_of(*order, who.participant->name, whom == nullptr ? std::string() : whom->name);
  const auto why = received
                       ? hands_.hand_over({tool_slot(order->participant, order->tool), *received})
                       : carry_out(*order, who, words);
  if (!why.empty()) return refuse(why);
  if (!is_chat) {
    log::info("{}", words);
    if (auto* gate = session_.options.gate)
      gate->note_action(who.applicant, name_of(order->action));
  }
  proto::LessonRecord record;
  describe(*order, slot, true, words, *record.mutable_teach());
  if (received) {
    record.mutable_teach()->set_tool(tool_slot(order->participant, order->tool).value);
    record.mutable_teach()->set_receiver_tool(received->value);
  }
  proto::Envelope event;
  *event.mutable_teach_event() = record.teach();
  session_.record(wire::LessonKind::Said, record);
  session_.audience.broadcast(wire::encode_envelope(event));
  // Telling people may have ended anybody's session: `who` is not used from here on.
  if (order->action == TeachAction::Expel) session_.audience.put_out(order->participant, words);
  if (order->action == TeachAction::Wipe) drawing_.wipe();
  return std::nullopt;
}

void Teaching::describe(const TeachOrder& order, ParticipantSlot by, bool is_done,
                        const std::string& text, proto::TeachEvent& message) const {
  message.set_tick(session_.audience.newest_tick());
  message.set_action(static_cast<proto::TeachAction>(order.action));
  message.set_by(by.value);
  if (is_about_one(order.action)) message.set_participant(order.participant.value);
  message.set_is_done(is_done);
  message.set_text(text);
}

// Returns why it cannot be done; empty: it is done. What makes people leave, or sends more than can
// be skipped, is left to do once everybody is told.
std::string Teaching::carry_out(const TeachOrder& order, const Speaker& who,
                                const std::string& words) {
  auto& roster = session_.roster;
  const auto& by = who.participant->name;
  const auto* whom = roster.find(order.participant);
  const auto whose_tools = [&](const char* lacks) {
    return whom->slot.has_tools() ? std::string() : "not done: " + whom->name + lacks;
  };
  switch (order.action) {
    case TeachAction::Freeze:
    case TeachAction::Release: {
      if (auto why = whose_tools(" has no tools"); !why.empty()) return why;
      const bool freezes = order.action == TeachAction::Freeze;
      freezes ? hands_.held().freeze(whom->slot) : hands_.held().release(whom->slot);
      roster.set_frozen_by(whom->slot, freezes ? by : std::string());
      session_.has_changed = true;
      return {};
    }
    case TeachAction::TakeClaim:
      if (auto why = whose_tools(" holds nothing"); !why.empty()) return why;
      hands_.open(whom->slot);
      return {};
    case TeachAction::Expel:
      if (wire::rights_of(whom->role).may_teach) return "not done: nobody puts out an instructor";
      door_.put_out(session_.audience.find(whom->slot)->applicant);
      return {};
    case TeachAction::Rename: {
      if (const auto renamed = roster.rename(order.participant, order.text); !renamed)
        return "not done: " + renamed.error().message;
      if (auto* renamed = session_.audience.find(order.participant))
        renamed->participant->name = order.text;
      session_.has_changed = true;
      return {};
    }
    case TeachAction::Admit:
      if (!door_.admit(order.text)) return "not done: nobody called " + order.text + " waits";
      session_.is_told = false;
      return {};
    case TeachAction::Close:
    case TeachAction::Open:
      door_.set_closed(order.action == TeachAction::Close);
      session_.is_told = false;
      return {};
    case TeachAction::End:
      if (!session_.options.on_end_wanted) return "not done: this session ends by itself";
      session_.options.on_end_wanted(words);
      return {};
    case TeachAction::GiveView:
    case TeachAction::EndView:
      roster.set_leader(order.participant);
      drawing_.forget_view();
      session_.has_changed = true;
      return {};
    case TeachAction::Pause:
    case TeachAction::GoOn:
      return pace_.pause(order.action == TeachAction::Pause, by);
    case TeachAction::Slow:
      return pace_.slow(order.rate, by);
    case TeachAction::Wipe:
    case TeachAction::Note:
    case TeachAction::Chat:
    case TeachAction::HandOver:
    case TeachAction::None:
      return {};
  }
  return {};
}

void Teaching::release_unless_led() {
  const auto present = session_.roster.list();
  if (std::ranges::any_of(present,
                          [](const auto& who) { return wire::rights_of(who.role).may_teach; }))
    return;
  for (const auto& who : present) {
    hands_.held().release(who.slot);
    session_.roster.set_frozen_by(who.slot, {});
  }
  pace_.reset();
}

// Whoever gives may be away: it is what others can do for tissue that nobody's hand holds.
Result<ToolSlot> Teaching::find_receiving_tool(const TeachOrder& order) const {
  const auto* giver = session_.roster.find(order.participant);
  const auto* receiver = session_.roster.find(order.receiver);
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
  const auto& frame = session_.audience.newest_frame();
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

}  // namespace trocar::replication
