#include "server/session/recording/anonymise.h"

#include <google/protobuf/message.h>

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "common/budget/message_budget.h"
#include "common/journal/mcap_copy.h"
#include "common/journal/session_topics.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/recording/pseudonyms.h"

namespace trocar::recording {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using journal::JournalTopic;

constexpr JournalTopic kTopicsOfPeople[] = {JournalTopic::Participants, JournalTopic::Claims,
                                            JournalTopic::FrameState,   JournalTopic::Lesson,
                                            JournalTopic::Overview,     JournalTopic::Hands};
// These hold one name each, and nothing else.
constexpr std::string_view kNames[] = {
    "trocar.proto.Participant.name", "trocar.proto.Participant.frozen_by",
    "trocar.proto.Participants.waiting", "trocar.proto.ClaimEvent.holder_name",
    "trocar.proto.SessionPace.by"};
constexpr const char* kTakenOut = "(words taken out)";

bool is_name(const FieldDescriptor& field) {
  return std::ranges::find(kNames, std::string_view(field.full_name())) != std::end(kNames);
}

// Calls `visit(field, text)` for each text in a message and in those that it holds; what it gives
// back is put there.
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
              &message, field, i, visit(*field, reflection.GetRepeatedString(message, field, i)));
        else
          reflection.SetString(&message, field,
                               visit(*field, reflection.GetString(message, field)));
      }
    }
  }
}

// Talk, notes and reasons stand behind the first colon of a line, which says whose they are.
bool has_words(const proto::TeachEvent& event) {
  return event.action() == proto::TEACH_CHAT || event.action() == proto::TEACH_NOTE ||
         event.action() == proto::TEACH_EXPEL;
}
bool take_out_words(proto::TeachEvent& event, bool keeps_words) {
  const auto colon = event.text().find(": ");
  if (!has_words(event) || colon == std::string::npos) return false;
  if (!keeps_words) event.set_text(event.text().substr(0, colon + 2) + kTakenOut);
  return true;
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
        [](const journal::McapChannel& channel) { return topic_of_people(channel).has_value(); },
        {},
        [&](const journal::McapMessage& message) {
          const auto& channel = reader.channels().at(message.channel_id);
          decoded = decode(channel, message);
          if (!decoded) return false;
          each_text(*message_, [&](const FieldDescriptor& field, const std::string& text) {
            if (is_name(field)) pseudonyms_.add(text);
            return text;
          });
          return true;
        });
    return decoded.ok() ? report.status() : decoded;
  }

  Result<BytesView> change(const journal::McapChannel& channel,
                           const journal::McapMessage& message) {
    if (!topic_of_people(channel)) return message.data;
    if (auto decoded = decode(channel, message); !decoded) return decoded.error();
    if (auto* record = dynamic_cast<proto::LessonRecord*>(message_.get());
        record && record->has_teach())
      words_ += take_out_words(*record->mutable_teach(), keeps_words_);
    if (auto* overview = dynamic_cast<proto::Overview*>(message_.get()))
      for (auto& event : *overview->mutable_lesson()) take_out_words(event, keeps_words_);
    each_text(*message_, [&](const FieldDescriptor& field, const std::string& text) {
      return is_name(field) ? pseudonyms_.of_name(text) : pseudonyms_.within(text);
    });
    bytes_.resize(message_->ByteSizeLong());
    message_->SerializeToArray(bytes_.data(), static_cast<int>(bytes_.size()));
    return BytesView(bytes_);
  }

  std::size_t people() const { return pseudonyms_.count(); }
  std::uint64_t words() const { return words_; }

 private:
  static std::optional<JournalTopic> topic_of_people(const journal::McapChannel& channel) {
    const auto topic = journal::topic_of(channel.topic);
    const bool is_one =
        topic && std::ranges::find(kTopicsOfPeople, *topic) != std::end(kTopicsOfPeople);
    return is_one ? topic : std::nullopt;
  }
  Status decode(const journal::McapChannel& channel, const journal::McapMessage& message) {
    const auto& kind = journal::topic_message(*topic_of_people(channel));
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
  Anonymiser anonymiser(from, keeps_words);
  if (auto collected = anonymiser.collect(**opened); !collected) return collected.error();
  const journal::McapMetadata note{kAnonymisedMetadataName,
                                   {{"people", std::to_string(anonymiser.people())},
                                    {"words", keeps_words ? "kept" : "taken out"}}};
  const auto copied = copy_recording(
      **opened, to,
      [&](const journal::McapChannel& channel, const journal::McapMessage& message) {
        return anonymiser.change(channel, message);
      },
      note);
  if (!copied) return copied.error();
  return AnonymiseReport{anonymiser.people(), anonymiser.words()};
}

}  // namespace trocar::recording
