#include "client/ui/banner_text.h"

#include <gtest/gtest.h>

#include <cmath>

#include "client/ui/palette.h"

namespace trocar::ui {
namespace {

TEST(BannerText, ALiveSessionHasNone) {
  EXPECT_TRUE(banners_of(HudModel{}).empty());
}

TEST(BannerText, EachStateSaysWhatToDo) {
  HudModel model;
  model.frozen_text = "Eva keeps your tools where they are.";
  auto banners = banners_of(model);
  ASSERT_EQ(banners.size(), 1u);
  EXPECT_EQ(banners[0].text, "Eva keeps your tools where they are.");
  EXPECT_EQ(banners[0].advice, "Wait: they come back to your hands slowly when they are released.");

  model = {};
  model.has_loan = true;
  banners = banners_of(model);
  ASSERT_EQ(banners.size(), 1u);
  EXPECT_EQ(banners[0].text, "You have been handed an instrument that holds tissue.");
  model.frozen_text = "Eva keeps your tools where they are.";
  EXPECT_EQ(banners_of(model).size(), 1u) << "it does not move then";

  // It can be in there where tissue has closed over it.
  model = {};
  model.participants.resize(2);
  model.participants[1].is_inside = true;
  EXPECT_TRUE(banners_of(model).empty());
  model.participants[1].is_self = true;
  EXPECT_EQ(banners_of(model).at(0).advice,
            "Draw it out with the wheel, or move it off the organ.");

  model = {};
  model.surface_age_ms = 399;
  EXPECT_TRUE(banners_of(model).empty());
  model.surface_age_ms = 1249;
  banners = banners_of(model);
  ASSERT_EQ(banners.size(), 1u);
  EXPECT_EQ(banners[0].text, "This picture is 1.2 s old.");
  EXPECT_EQ(banners[0].advice, "The connection is slow or has stopped: wait before you cut.");

  model = {};
  model.figures.pace.rate.time_rate = 0.5f;
  model.has_own_tool = true;
  banners = banners_of(model);
  ASSERT_EQ(banners.size(), 1u);
  EXPECT_EQ(banners[0].text, "Time is slow, 50 % of real speed. Go on.");
  EXPECT_EQ(banners[0].advice, "");
  model.timeline = HudTimeline{};
  EXPECT_TRUE(banners_of(model).empty());

  model = {};
  model.recording_text = "the recording has ended: no space left";
  model.has_recording_ended = true;
  banners = banners_of(model);
  ASSERT_EQ(banners.size(), 1u);
  EXPECT_EQ(banners[0].advice,
            "The lesson goes on without it. Tell the host to make room on the disk, and to start "
            "the session again.");
  model.has_recording_ended = false;
  EXPECT_EQ(banners_of(model)[0].advice, "The lesson goes on. Tell the host to see to the disk.");
}

TEST(BannerText, WhoIsKeptWaitingIsToldSoAndSoAreTheOthers) {
  HudModel model;
  HudParticipant anna{.name = "Anna"};
  anna.waits = true;
  model.participants = {HudParticipant{.name = "Bo"}, anna};
  auto banners = banners_of(model);
  ASSERT_EQ(banners.size(), 1u);
  EXPECT_EQ(banners[0].text, "Held back, for moving faster than the server can follow: Anna");
  EXPECT_EQ(banners[0].advice, "You can go on as you do.");
  model.conduct.emplace();
  EXPECT_EQ(banners_of(model)[0].advice, "Freeze holds the tools of who goes on so.");
  model.conduct.reset();
  model.participants[1].is_self = true;
  banners = banners_of(model);
  ASSERT_EQ(banners.size(), 1u);
  EXPECT_EQ(banners[0].text,
            "Your instrument is held back: it moves faster than the server can follow.");
  EXPECT_EQ(banners[0].advice, "Draw back a little, and go on more slowly.");
}

// A picture may be old and time may stand still: that is what a pause is.
TEST(BannerText, APauseExplainsItself) {
  HudModel model;
  model.pace_text = "Ivy has paused the session.";
  model.is_paused = true;
  model.surface_age_ms = 60'000;
  model.figures.pace.rate.time_rate = 0.5f;
  const auto banners = banners_of(model);
  ASSERT_EQ(banners.size(), 1u);
  EXPECT_EQ(banners[0].text, model.pace_text);
}

TEST(BannerText, AClosedSessionHasOneBannerAlone) {
  HudModel model;
  model.status = "connection to 10.0.0.7:7690 broke: the server is gone";
  model.status_advice = advice_after(replica::CloseKind::Lost);
  model.is_away = true;
  model.surface_age_ms = 9000;
  model.frozen_text = "Eva keeps your tools where they are.";
  model.figures.pace.rate.time_rate = 0.5f;
  const auto banners = banners_of(model);
  ASSERT_EQ(banners.size(), 1u);
  EXPECT_EQ(banners[0].text, model.status);
  EXPECT_EQ(banners[0].advice,
            "Ask the host to start the session again, and join again. Close this window to leave.");
}

TEST(BannerText, NoMoreThanThreeAtATime) {
  HudModel model;
  model.frozen_text = "a";
  model.surface_age_ms = 900;
  model.figures.pace.rate.time_rate = 0.5f;
  model.recording_text = "b";
  model.view_text = "c";
  ASSERT_EQ(banners_of(model).size(), kMostBanners);
  EXPECT_EQ(banners_of(model)[0].text, "a");
}

TEST(BannerText, EveryEndSaysHowToLeave) {
  for (const auto kind :
       {replica::CloseKind::None, replica::CloseKind::Ended, replica::CloseKind::Refused,
        replica::CloseKind::Unreachable, replica::CloseKind::Lost})
    EXPECT_NE(std::string(advice_after(kind)).find("lose this window to leave"), std::string::npos);
}

TEST(BannerText, RefusalsSayWhoAndWhatToDo) {
  struct Line {
    replica::ClaimOutcome outcome;
    tool::Verb verb;
    const char *holder, *text;
  };
  const Line lines[] = {
      {replica::ClaimOutcome::RefusedHeld, tool::Verb::Grasp, "Bo",
       "Bo holds this tissue. Wait, or ask Bo to let go."},
      {replica::ClaimOutcome::RefusedHeld, tool::Verb::Push, "Bo",
       "Bo holds this tissue. Wait, or ask Bo to let go."},
      {replica::ClaimOutcome::RefusedHeld, tool::Verb::Cut, "Bo",
       "The blade is stopped: Bo holds the tissue ahead. Wait, or ask Bo to let go."},
      {replica::ClaimOutcome::RefusedHeld, tool::Verb::Grasp, "", "by the server"},
      {replica::ClaimOutcome::RefusedNothingInReach, tool::Verb::Grasp, "",
       "Nothing is in reach. Bring the tip within 8 mm of the surface."},
      {replica::ClaimOutcome::TakenOver, tool::Verb::Push, "Bo",
       "Bo has taken your tissue, because your hand was silent. Ask Bo to let go."},
      {replica::ClaimOutcome::Expired, tool::Verb::Grasp, "",
       "Your tool let go, because your hand was silent for too long. Grasp or push again."},
      {replica::ClaimOutcome::Slipped, tool::Verb::Grasp, "",
       "The tissue slipped out of your jaws. Grasp again, and pull less."},
      {replica::ClaimOutcome::Granted, tool::Verb::Grasp, "", "by the server"},
      {replica::ClaimOutcome::Released, tool::Verb::Grasp, "", "by the server"},
  };
  for (const Line& line : lines) {
    replica::Notice notice;
    notice.outcome = line.outcome;
    notice.verb = line.verb;
    notice.holder = line.holder;
    notice.text = "by the server";
    EXPECT_EQ(describe_notice(notice, true, 0.008f), line.text);
    EXPECT_EQ(describe_notice(notice, false, 0.008f), "by the server");
  }
}

// By WCAG 2, 4.5 makes small words readable.
TEST(Palette, WordsStandOutFromThePanel) {
  const auto luminance = [](const PaletteColour& c) {
    const auto linear = [](float v) {
      return v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f);
    };
    return 0.2126f * linear(c[0]) + 0.7152f * linear(c[1]) + 0.0722f * linear(c[2]);
  };
  for (const auto& colour : {kSkyBlue, kYellow, kOrange})
    EXPECT_GT((luminance(colour) + 0.05f) / (luminance(kPanelGround) + 0.05f), 4.5f);
  // Told apart by lightness alone.
  EXPECT_GT((luminance(kYellow) + 0.05f) / (luminance(kSkyBlue) + 0.05f), 1.5f);
  EXPECT_GT((luminance(kYellow) + 0.05f) / (luminance(kOrange) + 0.05f), 1.5f);
}

}  // namespace
}  // namespace trocar::ui
