// The replicator's part about what an instructor does with the organ as a whole, with people and
// with their tools, and about what people say.

#include <algorithm>
#include <cstdio>

#include "common/base/log.h"
#include "common/base/printable.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/replication/messages.h"
#include "server/session/replication/replicator_client.h"
#include "server/session/replication/validation.h"

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

}  // namespace

std::optional<Replicator::Ending> Replicator::handle_teach(Client& client,
                                                           const proto::TeachRequest& request) {
  const auto order = check_teach(request);
  if (!order) return Ending{EndReason::ProtocolError, order.error().message};
  const auto role = client.participant->role;
  const bool is_chat = order->action == TeachAction::Chat;
  if (!is_chat && !wire::rights_of(role).may_teach)
    return Ending{EndReason::Role, std::string("TeachRequest: \"") + name_of(order->action) +
                                       "\" is the instructor's, not of " + wire::one_of(role)};
  const auto slot = client.participant->slot;
  const auto refuse = [&](const std::string& why) {
    proto::Envelope answer;
    describe_teaching(*order, slot, false, why, *answer.mutable_teach_event());
    send(client, wire::encode_envelope(answer));
    return std::nullopt;
  };
  if (!client.sayings.take(is_chat ? 1 : 0.25, options_.clock_ns()))
    return refuse("not done: at most one line a second, or four other requests");
  const auto* whom = roster_.find(order->participant);
  if (is_about_one(order->action) && (whom == nullptr || whom->name != order->name))
    return refuse("not done: " + printable(order->name, 32) + " is not here any more");
  std::optional<ToolSlot> received;
  if (order->action == TeachAction::HandOver) {
    auto found = find_receiving_tool(*order);
    if (!found) return refuse("not done: " + found.error().message);
    received = *found;
  }
  const auto words =
      words_of(*order, client.participant->name, whom == nullptr ? std::string() : whom->name);
  const auto why = received ? hand_over({tool_slot(order->participant, order->tool), *received})
                            : carry_out(*order, client, words);
  if (!why.empty()) return refuse(why);
  if (!is_chat) {
    log::info("{}", words);
    if (options_.gate) options_.gate->note_action(client.applicant, name_of(order->action));
  }
  proto::LessonRecord record;
  describe_teaching(*order, slot, true, words, *record.mutable_teach());
  if (received) {
    record.mutable_teach()->set_tool(tool_slot(order->participant, order->tool).value);
    record.mutable_teach()->set_receiver_tool(received->value);
  }
  proto::Envelope event;
  *event.mutable_teach_event() = record.teach();
  record_lesson(record);
  broadcast(wire::encode_envelope(event));
  // Telling people may have ended anybody's session: `client` is not used from here on.
  if (order->action == TeachAction::Expel) put_out(order->participant, words);
  if (order->action == TeachAction::Wipe) wipe_drawing();
  return std::nullopt;
}

void Replicator::describe_teaching(const TeachOrder& order, ParticipantSlot by, bool is_done,
                                   const std::string& text, proto::TeachEvent& message) const {
  message.set_tick(newest_tick());
  message.set_action(static_cast<proto::TeachAction>(order.action));
  message.set_by(by.value);
  if (is_about_one(order.action)) message.set_participant(order.participant.value);
  message.set_is_done(is_done);
  message.set_text(text);
}

// Returns why it cannot be done; empty: it is done. What makes people leave, or sends more than can
// be skipped, is left to do once everybody is told.
std::string Replicator::carry_out(const TeachOrder& order, Client& client,
                                  const std::string& words) {
  const auto* whom = roster_.find(order.participant);
  const auto whose_tools = [&](const char* lacks) {
    return whom->slot.has_tools() ? std::string() : "not done: " + whom->name + lacks;
  };
  switch (order.action) {
    case TeachAction::Freeze:
    case TeachAction::Release: {
      if (auto why = whose_tools(" has no tools"); !why.empty()) return why;
      const bool freezes = order.action == TeachAction::Freeze;
      freezes ? held_tools_.freeze(whom->slot) : held_tools_.release(whom->slot);
      roster_.set_frozen_by(whom->slot, freezes ? client.participant->name : std::string());
      participants_changed_ = true;
      return {};
    }
    case TeachAction::TakeClaim:
      if (auto why = whose_tools(" holds nothing"); !why.empty()) return why;
      for (const auto& input : held_tools_.open(whom->slot)) {
        inbox_.push_sample(input);
        note_loan(input.tool);
      }
      return {};
    case TeachAction::Expel:
      if (wire::rights_of(whom->role).may_teach) return "not done: nobody puts out an instructor";
      door_.put_out(client_of(whom->slot)->applicant);
      return {};
    case TeachAction::Rename: {
      if (const auto renamed = roster_.rename(order.participant, order.text); !renamed)
        return "not done: " + renamed.error().message;
      if (auto* renamed = client_of(order.participant)) renamed->participant->name = order.text;
      participants_changed_ = true;
      return {};
    }
    case TeachAction::Admit:
      if (!door_.admit(order.text)) return "not done: nobody called " + order.text + " waits";
      are_participants_told_ = false;
      return {};
    case TeachAction::Close:
    case TeachAction::Open:
      door_.set_closed(order.action == TeachAction::Close);
      are_participants_told_ = false;
      return {};
    case TeachAction::End:
      if (!options_.on_end_wanted) return "not done: this session ends by itself";
      options_.on_end_wanted(words);
      return {};
    case TeachAction::GiveView:
    case TeachAction::EndView:
      roster_.set_leader(order.participant);
      last_view_.reset();
      participants_changed_ = true;
      return {};
    case TeachAction::Pause:
    case TeachAction::GoOn:
    case TeachAction::Slow:
      if (!options_.on_pace) return "not done: this session keeps its own pace";
      if (order.action == TeachAction::Slow) rate_ = order.rate;
      if (order.action == TeachAction::Pause && is_paused_) return "not done: it is paused already";
      if (order.action == TeachAction::GoOn && !is_paused_) return "not done: it goes on already";
      if (order.action != TeachAction::Slow) is_paused_ = order.action == TeachAction::Pause;
      set_pace(client.participant->name);
      return {};
    case TeachAction::Wipe:
    case TeachAction::Note:
    case TeachAction::Chat:
    case TeachAction::HandOver:
    case TeachAction::None:
      return {};
  }
  return {};
}

// Nobody else could release these tools, or let time go on.
void Replicator::release_unless_led() {
  const auto present = roster_.list();
  if (std::ranges::any_of(present,
                          [](const auto& who) { return wire::rights_of(who.role).may_teach; }))
    return;
  for (const auto& who : present) {
    held_tools_.release(who.slot);
    roster_.set_frozen_by(who.slot, {});
  }
  if (!is_paused_ && rate_ == 1) return;
  is_paused_ = false;
  rate_ = 1;
  set_pace({});
}

Replicator::Client* Replicator::client_of(ParticipantSlot slot) const {
  if (const auto away = away_.find(slot); away != away_.end()) return away->second.get();
  for (const auto& [id, client] : clients_)
    if (client->participant && client->participant->slot == slot) return client.get();
  return nullptr;
}

void Replicator::put_out(ParticipantSlot slot, const std::string& words) {
  auto* client = client_of(slot);
  if (client == nullptr) return;  // it was too slow for what was said of it
  if (away_.contains(slot)) {
    leave(*client);
    away_.erase(slot);
  } else {
    end_session(*client, {EndReason::PutOut, words});
  }
}

void Replicator::record_lesson(const proto::LessonRecord& record) {
  if (!options_.on_lesson) return;
  wire::LessonEntry entry{wire::LessonKind::Said, Bytes(record.ByteSizeLong())};
  record.SerializeToArray(entry.message.data(), static_cast<int>(entry.message.size()));
  options_.on_lesson(std::move(entry));
}

}  // namespace trocar::replication
