// A server is killed in the middle of a session; another one goes on with its recording. The cuts
// are there, the clients come back by themselves, and both recordings fit together.

#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <limits>

#include "common/base/json.h"
#include "common/journal/session_journal.h"
#include "proto/wire.pb.h"
#include "tests/e2e/programs.h"

namespace trocar::e2e {
namespace {

namespace fs = std::filesystem;

class Resume : public ::testing::Test {
 protected:
  Program resume(const std::vector<std::string>& extra = {}) {
    std::vector<std::string> arguments{"--resume",  session_.journal.string(),
                                       "--listen",  session_.address(),
                                       "--journal", next_.string(),
                                       "--summary", (session_.folder / "next.json").string()};
    arguments.insert(arguments.end(), extra.begin(), extra.end());
    return Program("trocar-server", arguments, log_);
  }
  // Runs trocar-journal; what it prints is returned.
  std::string journal(const std::vector<std::string>& arguments, int expected) {
    const auto log = session_.folder / "journal.log";
    Program program("trocar-journal", arguments, log);
    EXPECT_EQ(program.wait(200), expected) << read_text(log);
    return read_text(log);
  }
  void kill_server() {
    session_.server().signal(SIGKILL);
    EXPECT_EQ(session_.server().wait(10), 128 + SIGKILL);
  }

  Session session_{"elastic-liver", {"--pace", "10"}};
  fs::path next_ = session_.folder / "next.mcap", log_ = session_.folder / "next.log";
};

TEST_F(Resume, AKilledServersSessionGoesOnAndEverybodyComesBack) {
  auto scalpel = session_.hand("Scalpel", kScenes / "incise.toml");
  auto watcher = session_.client("Watcher", "observer");
  ASSERT_TRUE(session_.wait_for_tick(11'000)) << "so that there is a snapshot after the first cuts";
  kill_server();
  auto server = resume({"--pace", "10"});
  ASSERT_TRUE(wait_until(
      [&] {
        const auto text = read_text(log_);
        return text.find("Scalpel (surgeon) is back") != std::string::npos &&
               text.find("Watcher (observer) is back") != std::string::npos;
      },
      60))
      << read_text(log_);
  const auto said = read_text(log_);
  EXPECT_NE(said.find("going on with " + session_.journal.string()), std::string::npos) << said;
  EXPECT_NE(said.find("2 of 2 participants may come back"), std::string::npos) << said;
  const auto before = journal({"verify", session_.journal.string(), "--json"}, 6);
  EXPECT_NE(said.find("state hash " + json_value(before, "last_hash")), std::string::npos)
      << before;
  const auto last_tick = [](const fs::path& file) {
    const auto recorded = journal::SessionJournal::open(file.string());
    return recorded.ok() ? (*recorded)->info().last_tick : 0;
  };
  const Tick back = last_tick(next_);
  EXPECT_TRUE(wait_until([&] { return last_tick(next_) >= back + 3000; }, 60));
  server.signal(SIGTERM);
  ASSERT_EQ(server.wait(30), 0);
  const auto summary = read_text(session_.folder / "next.json");
  EXPECT_EQ(json_value(summary, "all_replicas_equal"), "true") << summary;
  EXPECT_EQ(json_number(summary, "returned"), 2);
  EXPECT_EQ(json_number(summary, "sessions"), 0) << "nobody had to join anew";
  EXPECT_EQ(scalpel.wait(20), 0);
  EXPECT_EQ(watcher.wait(20), 0);
  const auto hand = session_.summary_of("Scalpel");
  EXPECT_EQ(json_number(hand, "returns"), 1) << hand;
  EXPECT_EQ(json_value(hand, "equal"), "true");
  EXPECT_GT(json_number(hand, "surface_vertices"), 1634) << "the wound is there";
  journal({"verify", next_.string()}, 0);
  const auto info = journal({"info", next_.string(), "--json"}, 0);
  EXPECT_EQ(json_value(info, "file"), "session.mcap") << info;
  EXPECT_EQ(json_value(info, "tick"), json_value(before, "last_tick"));
  // Both are one recording, which verifies across the crash.
  const auto whole = (session_.folder / "whole.mcap").string();
  const auto merged = journal({"merge", session_.journal.string(), next_.string(), whole}, 0);
  EXPECT_NE(merged.find("of 2 recordings"), std::string::npos) << merged;
  const auto report = journal({"verify", whole, "--json"}, 0);
  EXPECT_EQ(json_value(report, "first_tick"), "1") << report;
  // And its last seconds, across the crash, are one.
  const auto crash = std::stod(json_value(before, "last_tick")) * 1e-3;
  const auto part = (session_.folder / "part.mcap").string();
  journal(
      {"trim", whole, part, "--from", std::to_string(crash - 1), "--to", std::to_string(crash + 1)},
      0);
  journal({"verify", part}, 0);
}

std::vector<proto::LessonStage> stages_in(const fs::path& file) {
  std::vector<proto::LessonStage> stages;
  auto journal = journal::SessionJournal::open(file.string());
  if (!journal.ok()) return stages;  // nothing is recorded yet
  (void)(*journal)->read_lessons(0, std::numeric_limits<Tick>::max(),
                                 [&](Tick, const proto::LessonRecord& record) {
                                   if (record.has_stage()) stages.push_back(record.stage());
                                   return true;
                                 });
  return stages;
}

// Two stages: the hand reaches the first, and is in the second when the server dies.
constexpr const char* kTwoStages = R"(title = "Two"
text = "t"
organ = "elastic-liver"
[[stage]]
name = "Hold"
text = "t"
goal = "hold"
hold_s = 1
[[stage.score]]
measure = "time_s"
full = 1
none = 60
[[stage]]
name = "Hold on"
text = "t"
hint = "a hint"
hint_after_s = 1
goal = "hold"
hands = 2
)";

TEST(ResumedLesson, GoesOnWithStageTimeAndPoints) {
  const auto folder = test_folder();
  std::ofstream(folder / "two.toml") << kTwoStages;
  std::ofstream(folder / "hold.toml")
      << "[[tool]]\nreach_mm = 16\nanchor = [0, -1, 0.9]\nanchor_on = \"extreme\"\n"
         "[[tool.key]]\ntime_s = 0\nposition_mm = [0, 0, 0]\nshaft = [-0.6, -0.25, 1]\n"
         "verb = \"grasp\"\n[[tool.key]]\ntime_s = 120\nposition_mm = [0, 0, 0]\n";
  Session session("elastic-liver", {"--lesson", folder / "two.toml"});
  auto anna = session.hand("Anna", folder / "hold.toml");
  ASSERT_TRUE(wait_until(
      [&] {
        const auto told = stages_in(session.journal);
        return !told.empty() && told.back().stage() == 1 && !told.back().hint().empty();
      },
      60));
  session.server().signal(SIGKILL);
  EXPECT_EQ(session.server().wait(10), 128 + SIGKILL);
  const auto before = stages_in(session.journal).back();
  const auto next = folder / "next.mcap", log = folder / "next.log";
  Program server("trocar-server",
                 {"--resume", session.journal, "--listen", session.address(), "--journal", next},
                 log);
  ASSERT_TRUE(wait_until([&] { return !stages_in(next).empty(); }, 60)) << read_text(log);
  const auto after = stages_in(next).front();
  EXPECT_EQ(after.SerializeAsString(), before.SerializeAsString())
      << after.ShortDebugString() << "\n"
      << before.ShortDebugString();
  EXPECT_NE(read_text(log).find("the lesson goes on: Two, stage 2 of 2"), std::string::npos)
      << read_text(log);
  EXPECT_TRUE(wait_until(
      [&] { return read_text(log).find("Anna (surgeon) is back") != std::string::npos; }, 30));
  // A second time, from the recording that knows the second half alone, once it holds a second of
  // it: with nothing at all nobody could go on.
  ASSERT_TRUE(wait_until(
      [&] {
        const auto journal = journal::SessionJournal::open(next.string());
        return journal.ok() &&
               (*journal)->info().last_tick > (*journal)->info().begin_tick() + kTicksPerSecond;
      },
      30));
  server.signal(SIGKILL);
  EXPECT_EQ(server.wait(10), 128 + SIGKILL);
  const auto told_last = stages_in(next).back();
  const auto last = folder / "last.mcap", last_log = folder / "last.log";
  Program third("trocar-server",
                {"--resume", next, "--listen", session.address(), "--journal", last}, last_log);
  ASSERT_TRUE(wait_until([&] { return !stages_in(last).empty(); }, 60)) << read_text(last_log);
  EXPECT_EQ(stages_in(last).front().SerializeAsString(), told_last.SerializeAsString());
  EXPECT_TRUE(wait_until(
      [&] { return read_text(last_log).find("Anna (surgeon) is back") != std::string::npos; }, 30));
  third.signal(SIGTERM);
  EXPECT_EQ(third.wait(30), 0);
  EXPECT_EQ(anna.wait(20), 0);
  // The report of the last part is of the whole session; without the others it says what it lacks.
  const auto assess = [&](const std::filesystem::path& file) {
    const auto output = folder / "assessed.json";
    Program program("trocar-journal", {"assess", file, "--json"}, output);
    EXPECT_EQ(program.wait(60), 0) << read_text(output);
    return Json::parse(read_text(output));
  };
  const auto whole = assess(last);
  EXPECT_TRUE(whole["notes"].empty()) << whole["notes"];
  ASSERT_EQ(whole["stages"].size(), 2u);
  EXPECT_NEAR(whole["stages"][0]["points"].get<double>(), before.result(0).points(), 0.01);
  const auto parts = folder / "parts", table = folder / "all.csv";
  std::filesystem::create_directory(parts);
  for (const auto& file : {session.journal, next, last})
    std::filesystem::copy(file, parts / file.filename());
  Program curves("trocar-journal", {"assess", parts, "--csv", table}, folder / "curves.log");
  EXPECT_EQ(curves.wait(60), 0) << read_text(folder / "curves.log");
  EXPECT_NE(read_text(table).find("last.mcap"), std::string::npos);
  EXPECT_EQ(read_text(table).find("next.mcap"), std::string::npos) << "it is a part of the last";
  std::filesystem::rename(next, folder / "elsewhere.mcap");
  const auto part = assess(last);
  ASSERT_FALSE(part["notes"].empty());
  EXPECT_NE(part["notes"][0].get<std::string>().find("next.mcap, which has to lie beside it"),
            std::string::npos)
      << part["notes"];
}

TEST_F(Resume, RefusesAnotherOrgan) {
  ASSERT_TRUE(session_.wait_for_tick(500));
  kill_server();
  auto server = resume({"--organ", "lattice"});
  EXPECT_EQ(server.wait(60), 2);
  EXPECT_NE(read_text(log_).find("another organ"), std::string::npos) << read_text(log_);
}

}  // namespace
}  // namespace trocar::e2e
