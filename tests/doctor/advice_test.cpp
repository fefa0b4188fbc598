// Words and grades that follow from figures.

#include "client/doctor/advice.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace trocar::doctor {
namespace {

Measurements good() {
  Measurements measured;
  measured.visit = {.server = "teacher:7690",
                    .address = "192.168.1.20",
                    .is_reached = true,
                    .is_joined = true,
                    .organ = "liver",
                    .seconds = 5,
                    .round_trip_ms = 2,
                    .round_trip_95_ms = 4,
                    .has_datagrams = true,
                    .frames_share = 1,
                    .session_speed = 1,
                    .frame_age_ms = 3,
                    .shown_later_ms = 20};
  measured.graphics = {.renderer = "Card", .has_display = true, .pictures_per_second = 100};
  measured.folder = "lessons";
  measured.free_bytes = 5e9;
  return measured;
}

// Returns the subjects of findings with that grade, each followed by a comma.
std::string subjects(const Advice& advice, Grade grade) {
  std::string text;
  for (const auto& finding : advice.findings)
    if (finding.grade == grade) text += finding.subject + ",";
  return text;
}

TEST(Advice, AGoodMachineIsToldTheAgeOfItsPicture) {
  const auto advice = judge(good());
  EXPECT_EQ(advice.grade, Grade::Good);
  // 3 ms on the way, 20 ms later, 10 ms for a picture.
  EXPECT_EQ(advice.verdict, "You can take part. The picture will be about 33 ms old.");
  for (const auto& finding : advice.findings) EXPECT_EQ(finding.advice, "") << finding.subject;
}

TEST(Advice, EachShortfallIsALimitOfItsOwnWithAnAdvice) {
  struct Case {
    const char* subject;
    void (*harm)(Measurements&);
  };
  const Case cases[] = {
      {"round trip,", [](Measurements& m) { m.visit.round_trip_95_ms = kGoodAgeMs + 1; }},
      {"loss,", [](Measurements& m) { m.visit.lost_share = kGoodLostShare + 0.01; }},
      {"loss,", [](Measurements& m) { m.visit.has_datagrams = false; }},
      {"bandwidth,", [](Measurements& m) { m.visit.frames_share = kGoodFramesShare - 0.01; }},
      {"session,", [](Measurements& m) { m.visit.session_speed = kGoodSessionSpeed - 0.01; }},
      {"graphics,", [](Measurements& m) { m.graphics.pictures_per_second = 20; }},
      {"display,", [](Measurements& m) { m.graphics.has_display = false; }},
      {"disk,", [](Measurements& m) { m.free_bytes = kGoodFreeBytes - 1; }},
      {"picture,", [](Measurements& m) { m.visit.frame_age_ms = 80; }},
  };
  for (const auto& [subject, harm] : cases) {
    auto measured = good();
    harm(measured);
    const auto advice = judge(measured);
    EXPECT_EQ(advice.grade, Grade::Limited) << subject;
    EXPECT_EQ(subjects(advice, Grade::Limited), subject);
    EXPECT_TRUE(advice.verdict.starts_with("You can take part, with limits.")) << subject;
    for (const auto& finding : advice.findings)
      EXPECT_EQ(finding.advice.empty(), finding.grade == Grade::Good) << finding.subject;
  }
}

TEST(Advice, WithoutASessionTheMachineAloneIsJudged) {
  auto measured = good();
  measured.visit = {};
  measured.visit.problem = "no session announces itself here";
  auto advice = judge(measured);
  EXPECT_EQ(advice.grade, Grade::Good);
  EXPECT_EQ(advice.verdict,
            "This machine can take part. No session was tried (no session announces itself here): "
            "with a link, trocar-doctor --join LINK tries that, too.");
  measured.graphics.has_display = false;
  EXPECT_EQ(judge(measured).grade, Grade::Limited);
  measured.graphics = {};
  measured.graphics.problem = "no OpenGL";
  EXPECT_EQ(judge(measured).grade, Grade::Impossible);
}

TEST(Advice, NobodyTakesPartWhomTheServerLetsNotInOrWithoutGraphics) {
  struct Case {
    const char* says;
    void (*harm)(Measurements&);
  };
  const Case cases[] = {
      {"no such name",
       [](Measurements& m) {
         m.visit = {"x:1", "", 0, false, false, false, false, "no such name"};
       }},
      {"does not answer",
       [](Measurements& m) {
         m.visit.is_reached = m.visit.is_joined = false;
         m.visit.problem = "does not answer";
       }},
      {"wrong code",
       [](Measurements& m) {
         m.visit.is_joined = false;
         m.visit.is_refused = true;
         m.visit.problem = "wrong code";
       }},
      {"no OpenGL",
       [](Measurements& m) {
         m.graphics = {};
         m.graphics.problem = "no OpenGL";
       }},
  };
  for (const auto& [says, harm] : cases) {
    auto measured = good();
    harm(measured);
    const auto advice = judge(measured);
    EXPECT_EQ(advice.grade, Grade::Impossible) << says;
    EXPECT_TRUE(advice.verdict.starts_with(std::string("You cannot take part. ") + says))
        << advice.verdict;
  }
}

TEST(Advice, TheJsonHasTheFiguresOfTheWords) {
  const auto measured = good();
  const auto json = to_json(judge(measured), measured);
  EXPECT_EQ(json.at("grade"), "good");
  EXPECT_DOUBLE_EQ(json.at("visit").at("picture_age_ms").get<double>(), 33);
  EXPECT_DOUBLE_EQ(json.at("disk").at("free_bytes").get<double>(), 5e9);
  EXPECT_TRUE(json.at("visit").at("clock_offset_ms").is_null());
}

}  // namespace
}  // namespace trocar::doctor
