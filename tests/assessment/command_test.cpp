// The command, as people run it.

#include <gtest/gtest.h>

#include "common/base/json.h"
#include "tests/assessment/recorded_lesson.h"
#include "tests/support/files.h"
#include "tests/support/program_fixture.h"

namespace trocar::assessment::testing {
namespace {

class AssessCommand : public trocar::testing::ProgramFixture {
 protected:
  AssessCommand() : ProgramFixture("trocar-journal") {}

  std::string recorded(const char* name, float force_n, const std::string& lesson = kFollowLesson) {
    Session session;
    session.names = {"<b>Anna</b>"};
    session.lesson = lesson;
    session.seconds = 3;
    record(at(name), session, [&](step::PublishedFrame& frame) {
      frame.tools = {tool_at(ToolSlot{0}, {0, 0.2f, 0}, {0, force_n, 0})};
    });
    return at(name);
  }
};

TEST_F(AssessCommand, PrintsASummaryAndWritesAReportThatLoadsNothing) {
  const auto file = recorded("one.mcap", 2);
  ASSERT_EQ(run({"assess", file, "--html", at("report.html"), "--csv", at("all.csv")}), 0) << log();
  EXPECT_NE(log().find("75 of 100 points, 2 of 2 stages over"), std::string::npos) << log();
  EXPECT_NE(log().find("First: reached, 50 points"), std::string::npos) << log();
  const auto page = read(at("report.html"));
  EXPECT_NE(page.find("&lt;b&gt;Anna&lt;/b&gt;"), std::string::npos);
  EXPECT_EQ(page.find("<b>Anna"), std::string::npos);
  EXPECT_EQ(page.find("<script"), std::string::npos);
  EXPECT_EQ(page.find("src=\"http"), std::string::npos);
  EXPECT_NE(page.find("data:image/svg+xml"), std::string::npos);
  EXPECT_NE(read(at("all.csv")).find("peak_force_n,2\n"), std::string::npos);
}

TEST_F(AssessCommand, PlotsBloodWhereSomeWasLost) {
  const auto write = [&](const char* name, std::uint64_t nl_per_tick) {
    record(at(name), {}, [&](step::PublishedFrame& frame) {
      frame.tools = {tool_at(ToolSlot{0}, {0, 0.2f, 0})};
      frame.figures.blood.emplace().shed_nl = nl_per_tick * frame.tick;
    });
    EXPECT_EQ(run({"assess", at(name), "--html", at("report.html")}), 0) << log();
    return read(at("report.html")).find("Blood lost since the session began") != std::string::npos;
  };
  EXPECT_TRUE(write("bled.mcap", 5'000));
  EXPECT_FALSE(write("dry.mcap", 0));
}

TEST_F(AssessCommand, ComparesWithExpertsAndHidesNames) {
  const auto file = recorded("one.mcap", 2);
  const auto better = recorded("expert.mcap", 0.5f), worse = recorded("other.mcap", 2.5f);
  ASSERT_EQ(run({"assess", file, "--expert", better, "--expert", worse, "--json", "--pseudonyms"}),
            0)
      << log();
  const auto json = Json::parse(log());
  EXPECT_EQ(json["points"], 75);
  EXPECT_EQ(json["stages"][0]["measures"]["peak_force_n"], 2);
  EXPECT_EQ(json["stages"][0]["hands"][0]["person"], "Person 1");
  bool has_peak = false;
  for (const auto& standing : json["experts"])
    if (standing["measure"] == "peak_force_n" && standing["tool"].is_null() &&
        standing["stage"] == 0) {
      has_peak = true;
      EXPECT_EQ(standing["percentile"], 50);
      EXPECT_EQ(standing["median"], 1.5);
    }
  EXPECT_TRUE(has_peak);
}

TEST_F(AssessCommand, AFolderGivesLearningCurves) {
  std::filesystem::create_directories(at("all"));
  recorded("all/a.mcap", 2.5f);
  recorded("all/b.mcap", 1);
  ASSERT_EQ(run({"assess", at("all"), "--html", at("curves.html"), "--xapi", at("x.json")}), 0)
      << log();
  EXPECT_NE(log().find("62 points"), std::string::npos) << log();
  EXPECT_NE(log().find("100 points"), std::string::npos) << log();
  EXPECT_NE(read(at("curves.html")).find("Learning curves"), std::string::npos);
  EXPECT_EQ(Json::parse(read(at("x.json"))).size(), 4u);
}

TEST_F(AssessCommand, AFolderIsReadWithThoseBelowItAndWhatCannotBeReadIsNamed) {
  for (const char* folder : {"all", "all/one", "all/two"})
    std::filesystem::create_directories(at(folder));
  recorded("all/one/session.mcap", 2.5f);
  recorded("all/two/session.mcap", 1);
  write("all/empty.mcap", "");
  write("all/two/foreign.mcap", "no recording at all");
  std::filesystem::create_symlink("nowhere", at("all/gone.mcap"));
  EXPECT_EQ(run({"assess", at("all"), "--csv", at("all.csv")}), 3);
  for (const char* says : {"all/empty.mcap: ", "all/two/foreign.mcap: ", "62 points", "100 points",
                           "  one/session.mcap\n", "  two/session.mcap\n"})
    EXPECT_NE(log().find(says), std::string::npos) << says << " in " << log();
  EXPECT_NE(read(at("all.csv")).find("\"one/session.mcap\","), std::string::npos);
  for (const char* bad : {"all/one/session.mcap", "all/two/session.mcap"})
    std::filesystem::remove(at(bad));
  EXPECT_EQ(run({"assess", at("all"), "--csv", at("none.csv")}), 3);
  EXPECT_FALSE(std::filesystem::exists(at("none.csv")));
}

TEST_F(AssessCommand, NoOutputTakesThePlaceOfARecordingOrOfAnotherOne) {
  const auto file = recorded("one.mcap", 2);
  const auto before = read(file);
  for (const char* option : {"--html", "--pdf", "--csv", "--xapi"}) {
    EXPECT_EQ(run({"assess", file, option, file}), 2);
    expect_line(std::string(option) + ": " + file + " is a recording");
  }
  EXPECT_EQ(read(file), before);
  EXPECT_EQ(run({"assess", file, "--html", at("x"), "--csv", at("x")}), 2);
  expect_line("--html and --csv: ");
  EXPECT_FALSE(std::filesystem::exists(at("x")));
}

TEST_F(AssessCommand, OptionsThatWouldDoNothingAreRefused) {
  const auto file = recorded("one.mcap", 2);
  EXPECT_EQ(run({"assess", file, "--pictures"}), 2);
  expect_line("--html or --pdf");
  EXPECT_EQ(run({"assess", file, "--home-page", "http://x.example"}), 2);
  expect_line("--xapi");
}

TEST_F(AssessCommand, RefusesInOneLine) {
  EXPECT_EQ(run({"assess", at("none.mcap")}), 3);
  expect_line("none.mcap");
  EXPECT_NE(run({"assess", recorded("bad.mcap", 1, "title = 3")}), 0);
  expect_line("bad.mcap: /lesson");
  std::filesystem::create_directories(at("empty"));
  EXPECT_NE(run({"assess", at("empty")}), 0);
  expect_line("has no recording");
  EXPECT_EQ(run({"assess", at("empty"), "--json"}), 2);
}

}  // namespace
}  // namespace trocar::assessment::testing
