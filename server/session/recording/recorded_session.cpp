#include "server/session/recording/recorded_session.h"

#include <algorithm>

#include "proto/journal.pb.h"
#include "server/organs/organ/organ_file.h"
#include "server/session/recording/tick_records.h"

namespace trocar::recording {

Result<organ::Organ> recorded_organ(journal::SessionJournal& journal, const std::string& path) {
  auto message = journal.organ();
  if (!message) return message.error();
  const std::string encoded = message->SerializeAsString();
  auto organ = organ::decode_organ(bytes_of(std::string_view(encoded)));
  if (!organ) return Error{organ.error().code, path + ": /organ: " + organ.error().message};
  if (organ::organ_hash(*organ) != journal.info().organ_hash)
    return Error{ErrorCode::BadFile, path + ": /organ is not the organ that the session names"};
  return organ;
}

std::vector<participants::Participant> recorded_hands(const journal::SessionInfo& info) {
  std::vector<participants::Participant> people;
  for (const auto& person : info.participants) {
    const ParticipantSlot slot{static_cast<std::uint8_t>(person.slot())};
    if (!slot.has_tools()) continue;
    const bool is_known =
        std::ranges::any_of(people, [&](const auto& p) { return p.slot == slot; });
    if (!is_known)
      people.push_back({slot, person.name(), participants::Role::Surgeon, {tool::ToolShape{}}});
  }
  return people;
}

Status read_ticks(journal::SessionJournal& journal,
                  const std::function<Status(const step::TickRecord& record, bool& stop)>& take) {
  step::TickRecord record;
  Status status;
  bool stop = false;
  const Status read = journal.read_tick_records(0, journal.info().last_tick,
                                                [&](Tick, const proto::TickRecord& message) {
                                                  status = from_message(message, record);
                                                  if (status) status = take(record, stop);
                                                  return status.ok() && !stop;
                                                });
  return status ? read : status;
}

}  // namespace trocar::recording
