#include "server/hall/plan/figures_text.h"

#include <gtest/gtest.h>

#include <string>

namespace trocar::hall {
namespace {

constexpr const char* kText = R"(# HELP trocar_paused 1 while an instructor has paused the session.
# TYPE trocar_paused gauge
trocar_paused 1
trocar_ticks_total 12345
trocar_time_rate 0.98
trocar_rate_level 3
trocar_tick_median_seconds 0.0004
trocar_tick_p99_seconds 0.0007
trocar_stage_median_seconds{stage="solve"} 0.0003
trocar_stage_median_seconds{stage="hash"} 0.00001
trocar_people{role="surgeon"} 2
trocar_people{role="observer"} 1
trocar_people_away 1
trocar_claims 4
)";

TEST(FiguresText, ReadsTheFiguresOfAServer) {
  const auto figures = read_figures(kText);
  EXPECT_EQ(figures.ticks, 12345u);
  EXPECT_EQ(figures.people, 3) << "who is away is counted once";
  EXPECT_EQ(figures.claims, 4);
  EXPECT_DOUBLE_EQ(figures.time_rate, 0.98);
  EXPECT_DOUBLE_EQ(figures.tick_median_s, 0.0004);
  EXPECT_DOUBLE_EQ(figures.tick_p99_s, 0.0007);
  EXPECT_DOUBLE_EQ(figures.slowest_stage_s, 0.0003);
  EXPECT_TRUE(figures.is_overloaded);
  EXPECT_TRUE(figures.is_paused);
}

TEST(FiguresText, LeavesOutWhatIsNoFigure) {
  for (const auto* text :
       {"trocar_people", "trocar_people NaN", "trocar_people +Inf", "trocar_people -3", "\n\n\n",
        "trocar_people{role=\"surgeon\"} 2x", "trocar_peoples 4", " 5", "# trocar_people 6"})
    EXPECT_EQ(read_figures(text).people, 0) << text;
  EXPECT_EQ(read_figures("trocar_people 1e300\n").people, 1'000'000) << "no number overflows";
}

TEST(FiguresText, ReadsEveryBeginningOfAText) {
  const std::string text = kText;
  for (std::size_t length = 0; length < text.size(); ++length)
    EXPECT_LE(read_figures(std::string_view(text).substr(0, length)).people, 3);
}

}  // namespace
}  // namespace trocar::hall
