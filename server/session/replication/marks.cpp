#include "server/session/replication/marks.h"

#include <algorithm>

#include "common/base/printable.h"
#include "common/wire/lesson.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/replication/messages.h"

namespace trocar::replication {
namespace {

constexpr std::uint64_t kLeastMarkGapNs = 1'000'000'000;
static_assert(hands::kMostMarks == wire::kMostMarks);

}  // namespace

std::optional<Ending> Marks::ask(const Speaker& who, const proto::MarkRequest& request,
                                 bool is_paused) {
  const auto role = who.participant->role;
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
  const bool is_return = wanted == hands::MarkAction::Return;
  const auto refuse = [&](const std::string& why) {
    session_.audience.send(who,
                           encode_mark_refusal(wanted, session_.audience.newest_tick(), name, why));
    return std::nullopt;
  };
  // Returning takes the simulation as long as beginning: what comes too soon is refused.
  const auto now = session_.now_ns();
  if (last_ns_ && now - *last_ns_ < kLeastMarkGapNs)
    return refuse("less than a second after the last request, ask again");
  if (is_pending_ && is_paused)
    return refuse("the session is paused, and another mark waits until it goes on");
  const auto number = number_of(name, is_return);
  if (!number) return refuse(number.error().message);
  last_ns_ = now;
  names_[*number] = name;
  is_pending_ = true;
  if (auto* gate = session_.options.gate)
    gate->note_action(who.applicant, is_return ? "return" : "mark");
  session_.inbox.push_mark(wanted, static_cast<std::uint8_t>(*number));
  return std::nullopt;
}

Result<std::size_t> Marks::number_of(const std::string& name, bool is_return) const {
  if (name.empty()) return std::size_t{0};
  const auto find = [this](const std::string& wanted) {
    return static_cast<std::size_t>(std::find(names_.begin() + 1, names_.end(), wanted) -
                                    names_.begin());
  };
  if (const auto number = find(name); number < names_.size()) return number;
  if (is_return) return Error{ErrorCode::Refused, "there is no mark called " + name};
  if (const auto unused = find({}); unused < names_.size()) return unused;
  return Error{ErrorCode::Refused, "there are " + std::to_string(names_.size() - 1) +
                                       " marks with names already: use one of these again"};
}

void Marks::note(const step::MarkEvent& event) {
  is_pending_ = false;
  proto::Envelope told;
  describe(event, names_[event.number], *told.mutable_mark_event());
  session_.audience.broadcast(wire::encode_envelope(told));
  if (!event.is_done) return;
  proto::LessonRecord record;
  record.mutable_teach()->set_tick(event.tick);
  record.mutable_teach()->set_is_done(true);
  record.mutable_teach()->set_text(told.mark_event().text());
  session_.record(wire::LessonKind::Said, record);
  if (event.action != hands::MarkAction::Set) return;
  is_set_[event.number] = true;
  session_.audience.broadcast(list());
}

bool Marks::show(const Speaker& newcomer) const {
  return std::ranges::count(is_set_, true) == 0 || session_.audience.send(newcomer, list());
}

wire::SharedBytes Marks::list() const {
  proto::Envelope message;
  auto& list = *message.mutable_mark_list();
  for (std::size_t number = 0; number < names_.size(); ++number)
    if (is_set_[number]) list.add_name(names_[number]);
  return wire::encode_envelope(message);
}

}  // namespace trocar::replication
