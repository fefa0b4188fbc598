#include "server/session/recording/sign.h"

#include "common/journal/mcap_copy.h"
#include "common/journal/recording_end.h"
#include "common/journal/session_journal.h"

namespace trocar::recording {

Result<SignReport> sign(const std::string& from, const std::string& to,
                        const secure::SigningKey& key) {
  auto journal = journal::SessionJournal::open(from);
  if (!journal) return journal.error();
  auto reader = journal::McapReader::open(from);
  if (!reader) return reader.error();
  if (auto right = journal::refuse_wrong_end(**reader); !right) return right.error();
  if (!(*journal)->info().is_finished)
    return Error{ErrorCode::BadFile,
                 from + ": its end is missing, nobody can sign that it is whole"};
  SignReport report;
  if (const auto end = journal::check_counts(**reader);
      end.status == journal::EndStatus::Unpromised)
    report.note = end.text;
  journal::CopyOptions options;
  options.key = &key;
  const auto copied = journal::copy_recording(**reader, to, options);
  if (!copied) return copied.error();
  report.messages = copied->messages;
  return report;
}

}  // namespace trocar::recording
