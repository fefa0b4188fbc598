#include "server/session/recording/recorded_session.h"

#include <algorithm>

#include "common/wire/tool_shape.h"
#include "proto/journal.pb.h"
#include "server/organs/organ/organ_file.h"
#include "server/session/recording/load_messages.h"
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

Result<step::LoadRules> recorded_loads(journal::SessionJournal& journal, const organ::Organ& organ,
                                       const std::string& path) {
  auto message = journal.loads();
  if (!message) return message.error();
  if (!*message) return step::LoadRules{};
  auto rules = from_message(**message, organ);
  if (!rules) return Error{rules.error().code, path + ": /loads: " + rules.error().message};
  return rules;
}

std::vector<participants::Participant> participants_of(const proto::Participants& list) {
  std::vector<participants::Participant> present;
  for (const auto& entry : list.participant()) {
    if (entry.slot() >= kMaxParticipants) continue;
    auto& participant = present.emplace_back();
    participant.slot = {static_cast<std::uint8_t>(entry.slot())};
    participant.name = entry.name();
    participant.role = wire::role_of(entry.role());
    for (const auto& shape : entry.tool()) participant.tools.push_back(wire::read(shape));
  }
  return present;
}

Result<std::vector<PresentHands>> recorded_hands(journal::SessionJournal& journal) {
  std::vector<PresentHands> lists;
  const auto read = journal.read_participants(
      0, journal.info().last_tick, [&](Tick tick, const proto::Participants& list) {
        auto hands = participants_of(list);
        std::erase_if(hands, [](const auto& who) { return !who.slot.has_tools(); });
        lists.push_back({tick, std::move(hands)});
        return true;
      });
  if (!read) return read.error();
  return lists;
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
