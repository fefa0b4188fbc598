// The replicator's part about the organ and its time as a whole: marks to return to, pausing, and
// slow time. Pace decides when a tick comes, never what it does.

#include "common/base/log.h"
#include "common/base/printable.h"
#include "common/wire/lesson.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/replication/messages.h"
#include "server/session/replication/replicator_client.h"

namespace trocar::replication {
namespace {

constexpr std::uint64_t kLeastMarkGapNs = 1'000'000'000;
static_assert(hands::kMostMarks == wire::kMostMarks);

}  // namespace

std::optional<Replicator::Ending> Replicator::handle_mark(Client& client,
                                                          const proto::MarkRequest& request) {
  const auto role = client.participant->role;
  if (!wire::rights_of(role).may_mark)
    return Ending{EndReason::Role,
                  "MarkRequest: marks are the instructor's, not of " + wire::one_of(role)};
  const int action = request.action();
  if (action != proto::MARK_SET && action != proto::MARK_RETURN)
    return Ending{EndReason::ProtocolError, "MarkRequest.action: " + std::to_string(action) +
                                                " is not 1 (set) or 2 (return)"};
  const auto& name = request.name();
  if (name.size() > wire::kMostMarkName || !is_printable(name))
    return Ending{EndReason::ProtocolError,
                  "MarkRequest.name: it must be printable UTF-8 of at most " +
                      std::to_string(wire::kMostMarkName) + " bytes"};
  const auto wanted = static_cast<hands::MarkAction>(action);
  const auto refuse = [&](const std::string& why) {
    send(client, encode_mark_refusal(wanted, newest_tick(), name, why));
    return std::nullopt;
  };
  // Returning takes the simulation as long as beginning: what comes too soon is refused.
  const auto now = options_.clock_ns();
  const bool is_return = wanted == hands::MarkAction::Return;
  if (last_mark_ns_ && now - *last_mark_ns_ < kLeastMarkGapNs)
    return refuse("less than a second after the last request, ask again");
  if (is_mark_pending_ && is_paused_)
    return refuse("the session is paused, and another mark waits until it goes on");
  std::size_t number = 0;
  while (!name.empty() && number < mark_names_.size() && mark_names_[number] != name) ++number;
  if (number == mark_names_.size()) {
    number = 1;
    while (!is_return && number < mark_names_.size() && !mark_names_[number].empty()) ++number;
    if (is_return) return refuse("there is no mark called " + name);
    if (number == mark_names_.size())
      return refuse("there are " + std::to_string(mark_names_.size() - 1) +
                    " marks with names already: use one of these again");
  }
  last_mark_ns_ = now;
  mark_names_[number] = name;
  is_mark_pending_ = true;
  if (options_.gate) options_.gate->note_action(client.applicant, is_return ? "return" : "mark");
  inbox_.push_mark(wanted, static_cast<std::uint8_t>(number));
  return std::nullopt;
}

void Replicator::note_mark(const step::MarkEvent& event) {
  is_mark_pending_ = false;
  const auto& name = mark_names_[event.number];
  proto::Envelope told;
  describe(event, name, *told.mutable_mark_event());
  broadcast(wire::encode_envelope(told));
  if (!event.is_done) return;
  proto::LessonRecord record;
  record.mutable_teach()->set_tick(event.tick);
  record.mutable_teach()->set_is_done(true);
  record.mutable_teach()->set_text(told.mark_event().text());
  record_lesson(record);
  if (event.action != hands::MarkAction::Set) return;
  is_marked_[event.number] = true;
  broadcast(mark_list());
}

wire::SharedBytes Replicator::mark_list() const {
  proto::Envelope message;
  auto& list = *message.mutable_mark_list();
  for (std::size_t number = 0; number < mark_names_.size(); ++number)
    if (is_marked_[number]) list.add_name(mark_names_[number]);
  return wire::encode_envelope(message);
}

wire::SharedBytes Replicator::pace_message() const {
  proto::Envelope message;
  auto& pace = *message.mutable_session_pace();
  pace.set_rate(rate_);
  pace.set_is_paused(is_paused_);
  pace.set_by(paced_by_);
  return wire::encode_envelope(message);
}

// Hands move on while time stands still: their tools go back to them as after a freeze.
void Replicator::set_pace(const std::string& by) {
  paced_by_ = by;
  for (const auto& who : roster_.list()) {
    if (!who.slot.has_tools()) continue;
    if (is_paused_)
      held_tools_.freeze(who.slot);
    else if (who.frozen_by.empty())
      held_tools_.release(who.slot);
  }
  options_.on_pace(is_paused_ ? 0 : rate_);
  broadcast(pace_message());
}

}  // namespace trocar::replication
