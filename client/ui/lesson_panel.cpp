// The lesson: what to do, how far it is, and in the end how it went.

#include <algorithm>
#include <cstdint>

#include "client/ui/hud_panels.h"
#include "client/ui/panel_style.h"

namespace trocar::ui {
namespace {

constexpr float kMostPictureHeight = 110;

void draw_stage(const HudLesson& lesson, float scale) {
  ImGui::TextDisabled("%s", lesson.stage.c_str());
  ImGui::TextUnformatted(lesson.text.c_str());
  if (lesson.picture != 0) {
    // The organ is to be seen beside it.
    const float width = std::min(ImGui::GetContentRegionAvail().x,
                                 kMostPictureHeight * scale / lesson.picture_aspect);
    ImGui::Image(reinterpret_cast<ImTextureID>(static_cast<std::uintptr_t>(lesson.picture)),
                 {width, width * lesson.picture_aspect});
  }
  if (lesson.progress) {
    const auto percent = std::to_string(static_cast<int>(*lesson.progress * 100)) + " %";
    ImGui::ProgressBar(*lesson.progress, {-1, 14 * scale}, percent.c_str());
  }
  ImGui::TextDisabled("%s of %s", clock_text(lesson.seconds).c_str(),
                      clock_text(lesson.limit_s).c_str());
  if (lesson.force_limit_n > 0) {
    ImGui::SameLine();
    char text[64];
    std::snprintf(text, sizeof text,
                  lesson.is_too_strong ? "more than %.1f N: be gentler" : "at most %.1f N",
                  static_cast<double>(lesson.force_limit_n));
    if (lesson.is_too_strong)
      ImGui::TextColored(kTrouble, "%s", text);
    else
      ImGui::TextDisabled("%s", text);
  }
  if (!lesson.hint.empty()) ImGui::TextColored(kNotice, "%s", lesson.hint.c_str());
  if (lesson.can_answer) heading("Enter: it is here");
  if (!lesson.verdict.empty())
    ImGui::TextColored(lesson.is_right ? kGood : kTrouble, "%s", lesson.verdict.c_str());
  if (lesson.can_lead) ImGui::TextDisabled("N: next stage   K: from the beginning");
}

void draw_ways_on(const HudLesson& lesson, HudActions& actions) {
  constexpr std::pair<const char*, const char*> kWays[] = {
      {"Leave", "Leave (Backspace)"}, {"Repeat", "Repeat (K)"}, {"Next", "Next (N)"}};
  ImGui::Separator();
  for (std::size_t i = 0; i < std::size(kWays); ++i) {
    if (i > 0) ImGui::SameLine();
    // Keys act once it is over.
    if (ImGui::SmallButton(lesson.is_over ? kWays[i].second : kWays[i].first))
      actions.after_lesson = static_cast<AfterLesson>(i);
  }
}

}  // namespace

Box draw_lesson(const HudLesson& lesson, const Box& people, float scale, HudActions& actions) {
  const ImVec2 screen = ImGui::GetIO().DisplaySize;
  const float width = people.right > 0 ? people.right - people.left : 300 * scale;
  const float right = screen.x - kMargin * scale;
  ImGui::SetNextWindowPos({right, people.bottom + kMargin * scale}, 0, {1, 0});
  ImGui::SetNextWindowSizeConstraints({width, 0}, {width, 2000 * scale});
  ImGui::Begin("lesson", nullptr, lesson.can_go_on ? kPanel : kGlass);
  ImGui::PushTextWrapPos(width - ImGui::GetStyle().WindowPadding.x);
  heading(lesson.title.c_str());
  if (lesson.is_over) {
    char text[64];
    std::snprintf(text, sizeof text, "The lesson is over: %.0f of 100 points",
                  static_cast<double>(lesson.points));
    ImGui::TextColored(kGood, "%s", text);
    if (!lesson.outcome.empty()) ImGui::TextUnformatted(lesson.outcome.c_str());
    for (const auto& sentence : lesson.advice) ImGui::TextColored(kNotice, "%s", sentence.c_str());
  } else {
    draw_stage(lesson, scale);
  }
  for (const auto& [head, lines] : lesson.results) {
    ImGui::Separator();
    ImGui::TextUnformatted(head.c_str());
    if (lesson.is_over)
      for (const auto& line : lines) ImGui::TextDisabled("%s", line.c_str());
  }
  if (lesson.can_go_on) draw_ways_on(lesson, actions);
  ImGui::PopTextWrapPos();
  Box box = box_of_window();
  ImGui::End();
  box.top = people.top;
  return box;
}

}  // namespace trocar::ui
