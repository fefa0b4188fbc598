#include "server/session/recording/anonymise.h"

#include <google/protobuf/message.h>

#include <algorithm>
#include <iterator>
#include <memory>
#include <utility>
#include <vector>

#include "common/budget/message_budget.h"
#include "common/journal/mcap_copy.h"
#include "common/journal/recording_end.h"
#include "common/journal/session_topics.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/recording/pseudonyms.h"
#include "server/session/recording/recorded_texts.h"

namespace trocar::recording {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using journal::JournalTopic;

constexpr const char* kTakenOut = "(words taken out)";
constexpr std::string_view kToolTopics = "/tool/";  // states of tools: no text

// Calls `visit(message, field, text)` for each text in a message and in those that it holds; what
// it gives back is put there.
template <typename Visitor>
void each_text(Message& message, const Visitor& visit) {
  const auto& reflection = *message.GetReflection();
  std::vector<const FieldDescriptor*> fields;
  reflection.ListFields(message, &fields);
  for (const auto* field : fields) {
    const int count = field->is_repeated() ? reflection.FieldSize(message, field) : 1;
    for (int i = 0; i < count; ++i) {
      if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
        each_text(field->is_repeated() ? *reflection.MutableRepeatedMessage(&message, field, i)
                                       : *reflection.MutableMessage(&message, field),
                  visit);
      } else if (field->type() == FieldDescriptor::TYPE_STRING) {
        if (field->is_repeated())
          reflection.SetRepeatedString(
              &message, field, i,
              visit(message, *field, reflection.GetRepeatedString(message, field, i)));
        else
          reflection.SetString(&message, field,
                               visit(message, *field, reflection.GetString(message, field)));
      }
    }
  }
}

// Entries of metadata that say nothing of people. Others hold names of files.
constexpr std::string_view kHarmlessEntries[] = {
    "averaged_strain", "continues_tick", "damaged_chunks", "dropped_bytes", "end",
    "external_loads",  "from_tick",      "joins",          "organ_hash",    "organ_name",
    "people",          "protocol",       "sim_version",    "start",         "start_utc",
    "start_utc_ns",    "to_tick",        "trimmed_tick",   "words"};

journal::McapMetadata without_files(journal::McapMetadata metadata) {
  for (auto& [key, value] : metadata.entries)
    if (std::ranges::find(kHarmlessEntries, std::string_view(key)) == std::end(kHarmlessEntries))
      value = "(name taken out)";
  return metadata;
}

// This stands between two words of a sentence, such as a name that no list holds.
std::string between(const std::string& text, std::string_view before, std::string_view after) {
  const auto begin = text.find(before);
  if (begin == std::string::npos) return {};
  const auto from = begin + before.size();
  return text.substr(from, text.rfind(after) - from);
}

// Returns where words that people typed begin in such an event's line; npos: there are none. Names
// in it are pseudonyms already.
std::size_t begin_of_words(const proto::TeachEvent& event, const std::string& text) {
  switch (event.action()) {
    case proto::TEACH_CHAT:
    case proto::TEACH_NOTE:
    case proto::TEACH_EXPEL: {
      const auto colon = text.find(": ");
      return colon == std::string::npos ? colon : colon + 2;
    }
    case proto::TEACH_NONE:  // of a mark, or a lesson's news
      return text.starts_with("the instructor has ") ? text.find('"') : std::string::npos;
    default:  // a newer program's may be anything
      return proto::TeachAction_IsValid(event.action()) ? std::string::npos : 0;
  }
}

class Anonymiser {
 public:
  // path: of the recording, for messages.
  Anonymiser(std::string path, bool keeps_words)
      : path_(std::move(path)), keeps_words_(keeps_words) {}

  // Names are known before the first text is changed: a list may follow a sentence.
  Status collect(journal::McapReader& reader) {
    Status decoded;
    const auto report = reader.read(
        [](const journal::McapChannel& channel) { return tells_of_people(channel); }, {},
        [&](const journal::McapMessage& message) {
          const auto& channel = reader.channels().at(message.channel_id);
          decoded = decode(channel, message);
          if (!decoded) return false;
          each_text(*message_, [&](const Message& holder, const FieldDescriptor& field,
                                   const std::string& text) {
            add_names(holder, kind_of_text(field.full_name()), text);
            return text;
          });
          return true;
        });
    return decoded.ok() ? report.status() : decoded;
  }

  Result<BytesView> change(const journal::McapChannel& channel,
                           const journal::McapMessage& message) {
    const auto topic = journal::topic_of(channel.topic);
    if (!topic && !channel.topic.starts_with(kToolTopics))
      return Error{ErrorCode::BadFile,
                   path_ + ": " + channel.topic +
                       ": another release has written it, and it may hold names: use that one"};
    if (!tells_of_people(channel)) return message.data;
    if (auto decoded = decode(channel, message); !decoded) return decoded.error();
    each_text(*message_,
              [&](const Message& holder, const FieldDescriptor& field,
                  const std::string& text) -> std::string {
                switch (kind_of_text(field.full_name())) {
                  case TextKind::Harmless:
                    return text;
                  case TextKind::Name:
                    return pseudonyms_.of_name(text);
                  case TextKind::Sentence:
                    return pseudonyms_.within(text);
                  case TextKind::Teaching:
                    return without_words(static_cast<const proto::TeachEvent&>(holder),
                                         *topic == JournalTopic::Lesson, pseudonyms_.within(text));
                  case TextKind::Unlisted:
                    break;
                }
                return kTakenOut;
              });
    bytes_.resize(message_->ByteSizeLong());
    message_->SerializeToArray(bytes_.data(), static_cast<int>(bytes_.size()));
    return BytesView(bytes_);
  }

  std::size_t people() const { return pseudonyms_.count(); }
  std::uint64_t words() const { return words_; }

 private:
  static bool tells_of_people(const journal::McapChannel& channel) {
    const auto topic = journal::topic_of(channel.topic);
    return topic && recording::tells_of_people(journal::topic_message(*topic));
  }
  // Who waited is in no list, and neither is a name before it was changed.
  void add_names(const Message& holder, TextKind kind, const std::string& text) {
    if (kind == TextKind::Name) pseudonyms_.add(text);
    if (kind != TextKind::Teaching) return;
    const auto action = static_cast<const proto::TeachEvent&>(holder).action();
    if (action == proto::TEACH_ADMIT) pseudonyms_.add(between(text, " lets ", " in"));
    if (action == proto::TEACH_RENAME) pseudonyms_.add(between(text, " has renamed ", " to "));
  }
  std::string without_words(const proto::TeachEvent& event, bool counts, std::string text) {
    const auto begin = begin_of_words(event, text);
    if (begin == std::string::npos) return text;
    words_ += counts;
    return keeps_words_ ? text : text.substr(0, begin) + kTakenOut;
  }
  Status decode(const journal::McapChannel& channel, const journal::McapMessage& message) {
    const auto& kind = journal::topic_message(*journal::topic_of(channel.topic));
    message_.reset(
        google::protobuf::MessageFactory::generated_factory()->GetPrototype(&kind)->New());
    const bool is_read =
        check_budget(kind, message.data, build_budget(message.data.size())).ok() &&
        message_->ParseFromArray(message.data.data(), static_cast<int>(message.data.size()));
    // A newer program may have written names into fields that are not known here.
    message_->DiscardUnknownFields();
    if (is_read) return {};
    return Error{ErrorCode::BadFile,
                 path_ + ": " + channel.topic + ": holds a message that cannot be decoded"};
  }

  std::string path_;
  bool keeps_words_;
  Pseudonyms pseudonyms_;
  std::unique_ptr<Message> message_;
  Bytes bytes_;
  std::uint64_t words_ = 0;
};

}  // namespace

Result<AnonymiseReport> anonymise(const std::string& from, const std::string& to,
                                  bool keeps_words) {
  auto opened = journal::McapReader::open(from);
  if (!opened) return opened.error();
  const auto damaged = [&] {
    return Error{
        ErrorCode::BadFile,
        from + ": is cut short or damaged: trocar-journal repair makes a whole file of it"};
  };
  if (!(*opened)->is_finished()) return damaged();
  if (auto right = journal::refuse_wrong_end(**opened); !right) return right.error();
  Anonymiser anonymiser(from, keeps_words);
  if (auto collected = anonymiser.collect(**opened); !collected) return collected.error();
  journal::CopyOptions options;
  options.change = [&](const journal::McapChannel& channel, const journal::McapMessage& message) {
    return anonymiser.change(channel, message);
  };
  options.change_metadata = without_files;
  options.note = journal::McapMetadata{kAnonymisedMetadataName,
                                       {{"people", std::to_string(anonymiser.people())},
                                        {"words", keeps_words ? "kept" : "taken out"}}};
  const auto copied = copy_recording(**opened, to, options);
  if (!copied) return copied.error();
  return AnonymiseReport{anonymiser.people(), anonymiser.words()};
}

}  // namespace trocar::recording
