// Lessons that ship, played to their end by scripted hands, well and badly.

#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <limits>
#include <optional>

#include "common/journal/session_journal.h"
#include "tests/e2e/programs.h"

namespace trocar::e2e {
namespace {

const std::filesystem::path kHands =
    std::filesystem::path(TROCAR_SOURCE_DIR) / "tests/e2e/lesson_hands";

struct Played {
  std::optional<proto::LessonResult> first;  // of the first stage; nothing: it is not over
  int answers = 0;
};

Played read(const std::filesystem::path& file) {
  Played played;
  auto journal = journal::SessionJournal::open(file);
  EXPECT_TRUE(journal.ok());
  const auto visit = [&](Tick, const proto::LessonRecord& record) {
    if (record.has_stage() && record.stage().result_size() > 0)
      played.first = record.stage().result(0);
    played.answers += record.has_input();
    return true;
  };
  EXPECT_TRUE((*journal)->read_lessons(0, std::numeric_limits<Tick>::max(), visit).ok());
  return played;
}

// Plays a hand for so many seconds, or until the first stage is over.
Played play(const std::string& lesson, const std::string& hand, int seconds,
            const std::vector<std::string>& extra = {}) {
  Session session("liver", {"--lesson", lesson});
  std::vector<std::string> arguments{"--script", kHands / (hand + ".toml"), "--no-render"};
  arguments.insert(arguments.end(), extra.begin(), extra.end());
  auto client = session.client("Anna", "surgeon", arguments);
  wait_until(
      [&] { return read_text(session.folder / "server.log").find("points") != std::string::npos; },
      seconds);
  session.server().signal(SIGTERM);
  EXPECT_EQ(session.server().wait(30), 0);
  client.wait(30);
  Program verify("trocar-journal", {"verify", session.journal}, session.folder / "verify.log");
  EXPECT_EQ(verify.wait(300), 0) << read_text(session.folder / "verify.log");
  std::filesystem::rename(session.journal, session.folder / (hand + ".mcap"));
  std::filesystem::remove(session.folder / "ready");  // another session may follow in this folder
  return read(session.folder / (hand + ".mcap"));
}

TEST(Lessons, WhoFeelsTheLumpFindsIt) {
  const auto well = play("find-the-lump", "find-well", 60, {"--answer-at", "8"});
  ASSERT_TRUE(well.first);
  EXPECT_TRUE(well.first->is_reached());
  EXPECT_GT(well.first->points(), 90);
  EXPECT_EQ(well.answers, 1);
  const auto badly = play("find-the-lump", "find-badly", 14, {"--answer-at", "8"});
  EXPECT_FALSE(badly.first);
  EXPECT_EQ(badly.answers, 1);
}

TEST(Lessons, WhoKeepsOnThePointFollowsIt) {
  const auto well = play("follow-the-point", "follow-well", 60);
  ASSERT_TRUE(well.first);
  EXPECT_TRUE(well.first->is_reached());
  EXPECT_GT(well.first->points(), 90);
  EXPECT_FALSE(play("follow-the-point", "follow-badly", 16).first);
}

TEST(Lessons, WhoCutsAlongTheLineReachesItsEnd) {
  const auto well = play("along-the-line", "incise-well", 60);
  ASSERT_TRUE(well.first);
  EXPECT_TRUE(well.first->is_reached());
  EXPECT_GT(well.first->points(), 60);
  EXPECT_FALSE(play("along-the-line", "incise-badly", 16).first);
}

TEST(Lessons, WhoPullsGentlyGetsMorePoints) {
  const auto well = play("lift-gently", "lift-well", 60);
  const auto badly = play("lift-gently", "lift-badly", 60);
  ASSERT_TRUE(well.first && badly.first);
  EXPECT_TRUE(well.first->is_reached());
  EXPECT_GT(well.first->points(), badly.first->points() + 10);
}

// Clients are told nothing of what lies in the organ.
TEST(Lessons, HiddenStructuresAreInNoMessage) {
  const auto file = test_folder() / "hidden.toml";
  std::ofstream(file) << "title = \"T\"\ntext = \"t\"\n"
                         "[[structure]]\nname = \"zebra\"\ncentre_mm = [-50, 15, 50]\n"
                         "radius_mm = 14\n"
                         "[[stage]]\nname = \"S\"\ntext = \"t\"\ngoal = \"find\"\n"
                         "structure = \"zebra\"\nlimit_s = 2\n";
  Session session("liver", {"--lesson", file});
  auto client =
      session.client("Anna", "surgeon", {"--script", kHands / "find-well.toml", "--no-render"});
  EXPECT_TRUE(session.wait_for_tick(5000));
  session.server().signal(SIGTERM);
  EXPECT_EQ(session.server().wait(30), 0);
  client.wait(30);
  auto journal = journal::SessionJournal::open(session.journal);
  ASSERT_TRUE(journal.ok());
  int organs = 0, stages = 0;
  (*journal)->read_all([&](std::string_view topic, Tick, BytesView bytes) {
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const bool tells = text.find("zebra") != std::string_view::npos;
    // The organ and the state are for simulating again. Of the lesson its file is, and stages are
    // told.
    if (topic == "/organ" || topic == "/world/snapshot") {
      organs += tells;
      return true;
    }
    if (topic == "/lesson") {
      proto::LessonRecord record;
      EXPECT_TRUE(record.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
      stages += record.has_stage();
      EXPECT_TRUE(!tells || record.has_lesson()) << record.ShortDebugString();
      return true;
    }
    EXPECT_FALSE(tells) << topic;
    return true;
  });
  EXPECT_GE(organs, 1);
  EXPECT_GE(stages, 2);
}

}  // namespace
}  // namespace trocar::e2e
