// Lessons that ship, played to their end by scripted hands, well and badly.

#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <limits>
#include <vector>

#include "common/base/json.h"
#include "common/journal/session_journal.h"
#include "tests/e2e/programs.h"

namespace trocar::e2e {
namespace {

const std::filesystem::path kHands =
    std::filesystem::path(TROCAR_SOURCE_DIR) / "tests/e2e/lesson_hands";

struct Hand {
  std::string name, script;
};

struct Played {
  std::vector<proto::LessonResult> results;  // of stages that are over
  int answers = 0;
  Json assessed;  // by trocar-journal

  // Returns a number of a stage, as it was assessed.
  double measure(int stage, const char* key) const {
    return assessed["stages"][static_cast<std::size_t>(stage)]["measures"][key].get<double>();
  }
  // Returns a number of the only hand in the first stage.
  double skill(const char* key) const {
    return assessed["stages"][0]["hands"][0][key].get<double>();
  }
};

Played read(const std::filesystem::path& file) {
  Played played;
  auto journal = journal::SessionJournal::open(file);
  EXPECT_TRUE(journal.ok());
  const auto visit = [&](Tick, const proto::LessonRecord& record) {
    if (record.has_stage())
      played.results = {record.stage().result().begin(), record.stage().result().end()};
    played.answers += record.has_input();
    return true;
  };
  EXPECT_TRUE((*journal)->read_lessons(0, std::numeric_limits<Tick>::max(), visit).ok());
  return played;
}

// The report has to give what people were told.
void assess(const std::filesystem::path& file, Played& played) {
  const auto log = test_folder() / "assessed.json";
  Program program("trocar-journal", {"assess", file, "--json"}, log);
  ASSERT_EQ(program.wait(60), 0) << read_text(log);
  played.assessed = Json::parse(read_text(log));
  EXPECT_TRUE(played.assessed["notes"].empty()) << played.assessed["notes"];
  for (std::size_t i = 0; i < played.results.size(); ++i) {
    const auto& told = played.results[i];
    const auto& stage = played.assessed["stages"][i];
    EXPECT_EQ(stage["is_reached"], told.is_reached());
    EXPECT_NEAR(stage["points"].get<double>(), told.points(), 0.01);
  }
}

// Plays a lesson until so many stages are over, or for so many simulated seconds.
Played play(const std::string& lesson, const std::vector<Hand>& hands, int stages, int seconds,
            const std::vector<std::string>& extra = {}, const std::string& organ = "liver") {
  Session session(organ, at_pace(static_cast<int>(hands.size()),
                                 {"--lesson", lesson, "--seconds", std::to_string(seconds)}));
  std::vector<Program> clients;
  for (const auto& hand : hands) {
    std::vector<std::string> arguments{"--script", kHands / (hand.script + ".toml"), "--no-render"};
    arguments.insert(arguments.end(), extra.begin(), extra.end());
    clients.push_back(session.client(hand.name, "surgeon", arguments));
  }
  wait_until(
      [&] {
        const auto log = read_text(session.folder / "server.log");
        int over = 0;
        for (auto at = log.find(" points"); at != std::string::npos;
             at = log.find(" points", at + 1))
          over += log.compare(at - 4, 4, " 100") == 0;
        return over >= stages || !session.server().is_running();
      },
      300);
  session.server().signal(SIGTERM);
  EXPECT_EQ(session.server().wait(30), 0);
  for (auto& client : clients) client.wait(30);
  Program verify("trocar-journal", {"verify", session.journal}, session.folder / "verify.log");
  EXPECT_EQ(verify.wait(300), 0) << read_text(session.folder / "verify.log");
  const auto file = session.folder / (hands.back().script + ".mcap");
  std::filesystem::rename(session.journal, file);
  std::filesystem::remove(session.folder / "ready");  // another session may follow in this folder
  auto played = read(file);
  assess(file, played);
  return played;
}

TEST(Lessons, WhoFeelsTheLumpFindsIt) {
  const auto well = play("find-the-lump", {{"Anna", "find-well"}}, 1, 60, {"--answer-at", "8"});
  ASSERT_EQ(well.results.size(), 1u);
  EXPECT_TRUE(well.results[0].is_reached());
  EXPECT_GT(well.results[0].points(), 90);
  EXPECT_EQ(well.answers, 1);
  EXPECT_EQ(well.measure(0, "wrong_answers"), 0);
  const auto badly = play("find-the-lump", {{"Anna", "find-badly"}}, 1, 10, {"--answer-at", "8"});
  EXPECT_TRUE(badly.results.empty());
  EXPECT_EQ(badly.answers, 1);
  EXPECT_EQ(badly.assessed["stages"][0]["moments"][0]["text"], "gave a wrong answer");
}

TEST(Lessons, WhoKeepsOnThePointFollowsIt) {
  const auto well = play("follow-the-point", {{"Anna", "follow-well"}}, 1, 60);
  ASSERT_EQ(well.results.size(), 1u);
  EXPECT_TRUE(well.results[0].is_reached());
  EXPECT_GT(well.results[0].points(), 90);
  EXPECT_TRUE(play("follow-the-point", {{"Anna", "follow-badly"}}, 1, 13).results.empty());
}

TEST(Lessons, WhoCutsAlongTheLineReachesItsEnd) {
  const auto well = play("along-the-line", {{"Anna", "incise-well"}}, 1, 60);
  ASSERT_EQ(well.results.size(), 1u);
  EXPECT_TRUE(well.results[0].is_reached());
  EXPECT_GT(well.results[0].points(), 60);
  EXPECT_TRUE(play("along-the-line", {{"Anna", "incise-badly"}}, 1, 11).results.empty());
}

TEST(Lessons, WhoPullsGentlyGetsMorePoints) {
  const auto well = play("lift-gently", {{"Anna", "lift-well"}}, 1, 60);
  const auto badly = play("lift-gently", {{"Anna", "lift-badly"}}, 1, 60);
  ASSERT_TRUE(well.results.size() == 1 && badly.results.size() == 1);
  EXPECT_TRUE(well.results[0].is_reached());
  EXPECT_GT(well.results[0].points(), badly.results[0].points() + 10);
  for (const char* key : {"peak_force_n", "mean_force_n", "time_above_limit_s", "work_mj"})
    EXPECT_LT(well.skill(key), badly.skill(key)) << key;
}

TEST(Lessons, ThreeHoldAndCutTogether) {
  const auto well = play(
      "hold-for-another",
      {{"Anna", "hold-left"}, {"Ben", "hold-right-well"}, {"Carla", "cut-between-well"}}, 2, 90);
  ASSERT_EQ(well.results.size(), 2u);
  EXPECT_TRUE(well.results[0].is_reached());
  EXPECT_TRUE(well.results[1].is_reached());
  EXPECT_EQ(well.measure(0, "refusals"), 0);
  EXPECT_EQ(well.assessed["stages"][1]["hands"].size(), 3u);
  // Ben asks three times for what Anna holds, and then pulls.
  const auto badly =
      play("hold-for-another", {{"Anna", "hold-left"}, {"Ben", "hold-right-badly"}}, 1, 60);
  ASSERT_EQ(badly.results.size(), 1u);
  EXPECT_LT(badly.results[0].points(), well.results[0].points() - 10);
  EXPECT_EQ(badly.measure(0, "refusals"), 3);
  EXPECT_GT(badly.measure(0, "peak_force_n"), well.measure(0, "peak_force_n"));
}

TEST(Lessons, WhoCutsFarFromTheLumpTakesItOutWithItsMargin) {
  const auto well = play("take-it-out", {{"Anna", "remove-well"}}, 2, 120, {"--answer-at", "4"});
  ASSERT_EQ(well.results.size(), 2u);
  EXPECT_TRUE(well.results[0].is_reached());
  EXPECT_TRUE(well.results[1].is_reached());
  EXPECT_EQ(well.measure(1, "missing_margin_mm"), 0);
  EXPECT_EQ(well.measure(1, "harm_cm2"), 0);
  // The next one cuts through the lump.
  const auto badly = play("take-it-out", {{"Anna", "remove-badly"}}, 2, 120, {"--answer-at", "4"});
  ASSERT_EQ(badly.results.size(), 2u);
  EXPECT_LT(badly.results[1].points(), well.results[1].points() - 10);
  EXPECT_GT(badly.measure(1, "missing_margin_mm"), 3);
}

TEST(Lessons, WhoLetsNoRingFallGetsMorePoints) {
  const auto well = play("move-the-rings", {{"Anna", "carry-well"}}, 3, 90, {}, "pegs");
  ASSERT_EQ(well.results.size(), 3u);
  for (int stage = 0; stage < 3; ++stage) {
    EXPECT_TRUE(well.results[stage].is_reached());
    EXPECT_GT(well.results[stage].points(), 80);
    EXPECT_EQ(well.measure(stage, "drops"), 0);
  }
  const auto badly = play("move-the-rings", {{"Anna", "carry-badly"}}, 1, 60, {}, "pegs");
  ASSERT_EQ(badly.results.size(), 1u);
  EXPECT_TRUE(badly.results[0].is_reached());
  EXPECT_EQ(badly.measure(0, "drops"), 1);
  EXPECT_LT(badly.results[0].points(), well.results[0].points() - 10);
}

// Clients are told nothing of what lies in the organ.
TEST(Lessons, HiddenStructuresAreInNoMessage) {
  const auto file = test_folder() / "hidden.toml";
  std::ofstream(file) << "title = \"T\"\ntext = \"t\"\n"
                         "[[structure]]\nname = \"zebra\"\ncentre_mm = [-50, 15, 50]\n"
                         "radius_mm = 14\n"
                         "[[stage]]\nname = \"S\"\ntext = \"t\"\ngoal = \"find\"\n"
                         "structure = \"zebra\"\nlimit_s = 2\n";
  Session session("liver", at_pace(1, {"--lesson", file, "--seconds", "5"}));
  auto client =
      session.client("Anna", "surgeon", {"--script", kHands / "find-well.toml", "--no-render"});
  EXPECT_EQ(session.server().wait(300), 0);
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
