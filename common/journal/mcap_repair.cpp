#include "common/journal/mcap_repair.h"

#include <filesystem>

#include "common/journal/mcap_copy.h"
#include "common/journal/session_topics.h"

namespace trocar::journal {

Result<RepairReport> repair(const std::string& from, const std::string& to) {
  auto opened = McapReader::open(from);
  if (!opened) return opened.error();
  auto& reader = **opened;
  bool has_organ = false;
  const auto found = reader.read({}, {}, [&](const McapMessage& message) {
    has_organ |= reader.channels().at(message.channel_id).topic == topic_name(JournalTopic::Organ);
    return true;
  });
  if (reader.is_finished() && found.status().ok())
    return Error{ErrorCode::Usage, from + ": is whole, there is nothing to repair"};
  if (reader.header().profile == kJournalProfile && !has_organ)
    return Error{ErrorCode::BadFile,
                 from +
                     ": no organ; the recording ended too early, or is damaged there, and cannot "
                     "be repaired"};
  const RepairReport report{.messages = found.messages,
                            .dropped_bytes = reader.dropped_bytes(),
                            .damaged_chunks = found.damaged_chunks};
  const McapMetadata note{kRepairedMetadataName,
                          {{"file", std::filesystem::path(from).filename().string()},
                           {"dropped_bytes", std::to_string(report.dropped_bytes)},
                           {"damaged_chunks", std::to_string(report.damaged_chunks)}}};
  CopyOptions options;
  options.note = note;
  if (auto copied = copy_recording(reader, to, options); !copied) return copied.error();
  return report;
}

}  // namespace trocar::journal
