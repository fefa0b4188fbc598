// Comparison with experts, and tables for other programs.

#include "server/session/assessment/figures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <set>

#include "common/base/json.h"
#include "server/session/assessment/html.h"
#include "server/session/assessment/tables.h"

namespace trocar::assessment {
namespace {

Assessment session_of(double time_s, double economy) {
  Assessment session;
  session.file = "folder/a.mcap";
  session.name = "a.mcap";
  session.start_utc_ns = 1'700'000'000'000'000'000;
  session.lesson.emplace();
  session.lesson->title = "Lift it";
  session.lesson->stages.resize(1);
  Part part{.name = "One", .begin = 1000, .end = 3500, .stage = 0};
  part.result.emplace();
  part.result->values.fill(std::numeric_limits<double>::quiet_NaN());
  part.result->values[static_cast<std::size_t>(lesson::Measure::Time)] = time_s;
  part.result->is_reached = true;
  part.result->points = 75;
  part.hands = {{.tool = ToolSlot{0}, .person = "An,na"}};
  part.hands[0].skill.economy = economy;
  part.hands[0].skill.path_m = 1;
  session.stages = {part};
  session.points = 75;
  return session;
}

const Standing& find(const std::vector<Standing>& standings, const std::string& key) {
  return *std::ranges::find(standings, key, &Standing::key);
}

TEST(Compare, LessTimeAndMoreEconomyAreBetter) {
  const std::vector experts{session_of(10, 0.5), session_of(20, 0.6), session_of(30, 0.7),
                            session_of(40, 0.8)};
  auto standings = compare(session_of(15, 0.75), experts);
  ASSERT_TRUE(standings.ok());
  EXPECT_NEAR(find(*standings, "time_s").percentile, 75, 1e-9);
  EXPECT_NEAR(find(*standings, "time_s").median, 25, 1e-9);
  EXPECT_NEAR(find(*standings, "economy").percentile, 75, 1e-9);
  EXPECT_EQ(find(*standings, "economy").experts, 4u);
  // Who is equal counts by half.
  standings = compare(session_of(10, 0.5), experts);
  EXPECT_NEAR(find(*standings, "time_s").percentile, 87.5, 1e-9);
  EXPECT_NEAR(find(*standings, "economy").percentile, 12.5, 1e-9);
}

TEST(Compare, RefusesAnotherLesson) {
  auto other = session_of(10, 0.5);
  other.lesson->title = "Cut it";
  const auto standings = compare(session_of(10, 0.5), {other});
  ASSERT_FALSE(standings.ok());
  EXPECT_EQ(standings.error().message,
            "--expert: folder/a.mcap: gave another lesson than folder/a.mcap");
}

TEST(Tables, CsvHasARowForEachNumber) {
  const auto csv = csv_of({session_of(12.5, 0.5)});
  EXPECT_TRUE(csv.starts_with("file,start,lesson,stage,person,tool,measure,value\n"));
  EXPECT_NE(csv.find("\"a.mcap\",2023-11-14T22:13:20Z,\"Lift it\",\"One\",\"\",,time_s,12.5\n"),
            std::string::npos)
      << csv;
  EXPECT_NE(csv.find("\"One\",\"An,na\",0,economy,0.5\n"), std::string::npos) << csv;
}

TEST(Tables, StatementsHaveScoreDurationAndTheSameIdAgain) {
  const auto text = xapi_of({session_of(12.5, 0.5), session_of(12.5, 0.5)}, "https://lms.example");
  EXPECT_EQ(text, xapi_of({session_of(12.5, 0.5), session_of(12.5, 0.5)}, "https://lms.example"));
  const auto statements = Json::parse(text);
  ASSERT_EQ(statements.size(), 2u);
  const auto& one = statements[0];
  EXPECT_EQ(one["actor"]["account"]["name"], "An,na");
  EXPECT_EQ(one["verb"]["id"], "http://adlnet.gov/expapi/verbs/passed");
  EXPECT_EQ(one["object"]["id"], "https://lms.example/lessons/lift-it/one");
  EXPECT_EQ(one["result"]["score"]["scaled"], 0.75);
  EXPECT_EQ(one["result"]["duration"], "PT2.50S");
  EXPECT_EQ(one["timestamp"], "2023-11-14T22:13:23Z");
  const auto id = one["id"].get<std::string>();
  ASSERT_EQ(id.size(), 36u);
  EXPECT_EQ(id[8], '-');
  EXPECT_EQ(id[14], '8');
  EXPECT_EQ(id[19], 'a');
  EXPECT_EQ(id, statements[1]["id"]);
}

TEST(Html, MarkupInTextIsText) {
  EXPECT_EQ(html_text("<script>\"a\" & b</script>"),
            "&lt;script&gt;&quot;a&quot; &amp; b&lt;/script&gt;");
  EXPECT_NE(html_image("image/png", "abc", "x\"")
                .find("alt=\"x&quot;\" src=\"data:image/png;"
                      "base64,YWJj\""),
            std::string::npos);
}

}  // namespace
}  // namespace trocar::assessment
