// A copy without names verifies, and nobody finds a name in it.

#include "server/session/recording/anonymise.h"

#include <gtest/gtest.h>

#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <iterator>
#include <set>

#include "common/journal/session_journal_writer.h"
#include "server/session/recording/csv_text.h"
#include "server/session/recording/recorded_texts.h"
#include "server/session/recording/verify.h"
#include "tests/recording/recorded_simulation.h"
#include "tests/support/files.h"

namespace trocar::recording::testing {
namespace {

using trocar::testing::TemporaryFolder;

// All texts that a copy holds, one per line.
std::string all_bytes(const std::string& path) {
  std::string text;
  auto reader = journal::McapReader::open(path);
  EXPECT_TRUE(reader.ok());
  (*reader)->read({}, {}, [&](const journal::McapMessage& message) {
    text.append(reinterpret_cast<const char*>(message.data.data()), message.data.size());
    text += '\n';
    return true;
  });
  return text;
}

TEST(anonymise, a_session_verifies_without_its_names) {
  const TemporaryFolder folder;
  record_simulation(folder.file("a.mcap"));
  copy_journal(folder.file("a.mcap"), folder.file("b.mcap"), [](auto, auto&) { return true; });
  const std::string before = all_bytes(folder.file("b.mcap"));
  ASSERT_NE(before.find("Hand 0"), std::string::npos);
  const auto report = anonymise(folder.file("b.mcap"), folder.file("c.mcap"), false);
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_GE(report->people, 2u);
  EXPECT_EQ(report->words, 0u);
  const std::string after = all_bytes(folder.file("c.mcap"));
  EXPECT_EQ(after.find("Hand 0"), std::string::npos);
  EXPECT_NE(after.find("Person 1"), std::string::npos);
  const auto was = verify_journal(folder.file("b.mcap")),
             is = verify_journal(folder.file("c.mcap"));
  ASSERT_TRUE(was.ok() && is.ok());
  EXPECT_EQ(is->verdict(), Verdict::Verified) << is->why();
  EXPECT_EQ(is->ticks_verified, was->ticks_verified);
}

// Writes a session of people who talk.
std::string talk(const std::string& path) {
  auto created =
      journal::SessionJournalWriter::create(path, {.start_utc_ns = 1, .organ_name = "liver"});
  EXPECT_TRUE(created.ok());
  auto& writer = *created;
  proto::Participants people;
  const auto join = [&](std::uint32_t slot, const std::string& name) {
    auto* person = people.add_participant();
    person->set_slot(slot);
    person->set_name(name);
  };
  join(0, "Ann");
  join(1, "Ann Müller");
  people.mutable_participant(0)->set_frozen_by("Ivy");
  people.add_waiting("Zoë");
  EXPECT_TRUE(writer->write_participants(0, 1, people).ok());
  const auto say = [&](proto::TeachAction action, const std::string& text) {
    proto::LessonRecord record;
    record.mutable_teach()->set_action(action);
    record.mutable_teach()->set_text(text);
    EXPECT_TRUE(writer->write(journal::JournalTopic::Lesson, 1, 1, record).ok());
  };
  say(proto::TEACH_CHAT, "Ann Müller: ask Ann, or Annabel: she knows");
  say(proto::TEACH_EXPEL, "Ivy has put Zoë out: come back later");
  say(proto::TEACH_FREEZE, "Ivy keeps the tools of Ann where they are");
  EXPECT_TRUE(writer->close().ok());
  return path;
}

TEST(anonymise, words_that_people_typed_are_taken_out) {
  const TemporaryFolder folder;
  const auto report = anonymise(talk(folder.file("a.mcap")), folder.file("b.mcap"), false);
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->people, 4u);
  EXPECT_EQ(report->words, 2u);
  const std::string text = all_bytes(folder.file("b.mcap"));
  for (const char* name : {"Ann", "Ivy", "Zo", "later", "knows"})
    EXPECT_EQ(text.find(name), std::string::npos) << name;
  EXPECT_NE(text.find("Person 3: (words taken out)"), std::string::npos) << text;
  EXPECT_NE(text.find("Person 2 has put Person 4 out: (words taken out)"), std::string::npos)
      << text;
  EXPECT_NE(text.find("Person 2 keeps the tools of Person 1 where they are"), std::string::npos)
      << text;
}

TEST(anonymise, kept_words_lose_names_alone) {
  const TemporaryFolder folder;
  ASSERT_TRUE(anonymise(talk(folder.file("a.mcap")), folder.file("b.mcap"), true).ok());
  const std::string text = all_bytes(folder.file("b.mcap"));
  EXPECT_NE(text.find("Person 3: ask Person 1, or Annabel: she knows"), std::string::npos) << text;
}

// Names of who waited and of marks are in no list.
TEST(anonymise, sentences_and_metadata_hold_no_name_that_no_list_has) {
  const TemporaryFolder folder;
  {
    auto created = journal::SessionJournalWriter::create(
        folder.file("a.mcap"), {.start_utc_ns = 1,
                                .organ_name = "liver",
                                .continues = journal::Continuation{"Ada and Ben.mcap", 16}});
    ASSERT_TRUE(created.ok());
    const auto say = [&](int action, const std::string& text) {
      proto::LessonRecord record;
      record.mutable_teach()->set_action(static_cast<proto::TeachAction>(action));
      record.mutable_teach()->set_text(text);
      EXPECT_TRUE((*created)->write(journal::JournalTopic::Lesson, 17, 17, record).ok());
    };
    proto::Participants people;
    people.add_participant()->set_name("Ivy: the first");
    EXPECT_TRUE((*created)->write_participants(17, 17, people).ok());
    say(proto::TEACH_ADMIT, "Ivy: the first lets Zoë in");
    say(proto::TEACH_RENAME, "Ivy: the first has renamed Ben to Bea");
    say(proto::TEACH_CHAT, "Ivy: the first: hello");
    say(proto::TEACH_NONE, "the instructor has returned the organ to the mark \"Ada's cut\"");
    say(99, "Cleo does what a newer program can");
    ASSERT_TRUE((*created)->close().ok());
  }
  const auto report = anonymise(folder.file("a.mcap"), folder.file("b.mcap"), false);
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->words, 3u);
  std::string text = all_bytes(folder.file("b.mcap"));
  for (const char* name : {"Ivy", "first", "Zo", "Ben", "hello", "Ada", "cut", "Cleo"})
    EXPECT_EQ(text.find(name), std::string::npos) << name;
  EXPECT_NE(text.find("Person 1 lets Person 2 in"), std::string::npos) << text;
  const auto file = trocar::testing::load_file(folder.file("b.mcap"));
  text.assign(file.begin(), file.end());
  EXPECT_EQ(text.find("Ada"), std::string::npos) << "the part before";
}

// Calls `visit` with the full name of each text that such a message can hold.
template <typename Visitor>
void each_field(const google::protobuf::Descriptor& message, std::set<std::string>& seen,
                const Visitor& visit) {
  if (!seen.insert(message.full_name()).second) return;
  for (int i = 0; i < message.field_count(); ++i) {
    const auto& field = *message.field(i);
    if (field.type() == google::protobuf::FieldDescriptor::TYPE_STRING) visit(field.full_name());
    if (field.message_type() != nullptr) each_field(*field.message_type(), seen, visit);
  }
}

TEST(anonymise, each_text_of_the_schema_is_listed) {
  std::set<std::string> seen;
  std::size_t texts = 0;
  const auto is_listed = [&](const std::string& field) {
    EXPECT_NE(kind_of_text(field), TextKind::Unlisted)
        << field << ": say in recorded_texts.cpp what it tells of people";
    ++texts;
  };
  for (int i = 0; i < journal::kJournalTopicCount; ++i)
    each_field(journal::topic_message(static_cast<journal::JournalTopic>(i)), seen, is_listed);
  EXPECT_GT(texts, 20u);
  each_field(*proto::ToolState::descriptor(), seen,
             [](const std::string& field) { ADD_FAILURE() << field << ": tools have no text"; });
  EXPECT_EQ(kind_of_text("trocar.proto.Participant.nickname"), TextKind::Unlisted);
}

TEST(anonymise, no_cell_of_a_table_is_a_formula) {
  for (const char* name : {"=1+1", "+1", "-1", "@SUM(A1)"})
    EXPECT_EQ(csv_text(name), std::string("\"'") + name + '"');
  EXPECT_EQ(csv_text("Ann-Marie"), "\"Ann-Marie\"");
}

TEST(anonymise, it_overwrites_nothing) {
  const TemporaryFolder folder;
  const auto path = talk(folder.file("a.mcap"));
  const auto before = trocar::testing::load_file(path);
  const auto report = anonymise(path, path, false);
  ASSERT_FALSE(report.ok());
  EXPECT_EQ(report.error().code, ErrorCode::BadFile) << "as trim and merge";
  EXPECT_TRUE(report.error().message.starts_with(path + ": exists already"))
      << report.error().message;
  EXPECT_EQ(trocar::testing::load_file(path), before);
  auto bytes = before;
  bytes.resize(bytes.size() - 20);
  trocar::testing::save_file(folder.file("cut.mcap"), bytes);
  const auto cut = anonymise(folder.file("cut.mcap"), folder.file("b.mcap"), false);
  ASSERT_FALSE(cut.ok());
  EXPECT_NE(cut.error().message.find("is cut short or damaged"), std::string::npos);
  EXPECT_FALSE(anonymise(folder.file("none.mcap"), folder.file("b.mcap"), false).ok());
}

// A limit of this process stands for a disk without room, for the first byte and for later ones.
TEST(anonymise, a_disk_without_room_is_left_as_it_was) {
  const TemporaryFolder folder;
  const auto path = talk(folder.file("a.mcap"));
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  for (const rlim_t bytes : {rlim_t{0}, rlim_t{100}}) {
    const rlimit small{.rlim_cur = bytes, .rlim_max = before.rlim_max};
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
    const auto report = anonymise(path, folder.file("b.mcap"), false);
    setrlimit(RLIMIT_FSIZE, &before);
    ASSERT_FALSE(report.ok());
    EXPECT_EQ(report.error().code, ErrorCode::ResourceMissing);
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.file("")), {}), 1);
  }
  std::signal(SIGXFSZ, handler);
}

}  // namespace
}  // namespace trocar::recording::testing
