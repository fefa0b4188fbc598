// Two recordings beside each other: a panel in the corner of each, and a line between them.

#include <imgui.h>

#include <algorithm>

#include "client/ui/hud_panels.h"
#include "client/ui/panel_style.h"

namespace trocar::ui {
namespace {

// Returns where it is.
Box draw_half(const HudHalf& half, const char* id, float greatest_n, bool shows_rate, float scale) {
  const float most = half.width - 2 * kMargin * scale;
  ImGui::SetNextWindowPos({half.left + kMargin * scale, kMargin * scale});
  ImGui::SetNextWindowSizeConstraints({std::min(300 * scale, most), 0}, {most, 2000 * scale});
  ImGui::Begin(id, nullptr, kGlass);
  ImGui::PushTextWrapPos(most - ImGui::GetStyle().WindowPadding.x);
  heading(half.name.c_str());
  ImGui::Text("%s", clock_text(half.seconds).c_str());
  ImGui::SameLine();
  ImGui::TextDisabled("of %s", clock_text(half.last_seconds).c_str());
  for (const auto* text : {&half.organ, &half.blood}) {
    if (text->empty()) continue;
    ImGui::SameLine();
    ImGui::TextDisabled(" %s", text->c_str());
  }
  if (!half.stage.empty()) ImGui::TextDisabled("%s", half.stage.c_str());
  if (!half.participants.empty()) {
    ImGui::Separator();
    draw_people(half.participants, greatest_n, shows_rate, scale);
  }
  if (!half.stopped.empty()) {
    ImGui::PushStyleColor(ImGuiCol_Text, kTrouble);
    ImGui::TextWrapped("This recording cannot go on: %s", half.stopped.c_str());
    ImGui::PopStyleColor();
  } else if (!half.notice.empty()) {
    ImGui::TextColored(kNotice, "%s", half.notice.c_str());
  }
  ImGui::PopTextWrapPos();
  const Box box = box_of_window();
  ImGui::End();
  return box;
}

}  // namespace

void draw_pair(const HudModel& model, float scale) {
  ImDrawList* list = ImGui::GetBackgroundDrawList();
  const float height = ImGui::GetIO().DisplaySize.y;
  float bottom = 0;
  const char* ids[] = {"first", "second"};
  for (std::size_t i = 0; i < model.pair->halves.size(); ++i) {
    const HudHalf& half = model.pair->halves[i];
    const ImVec2 from = {half.left, 0}, to = {half.left + half.width, height};
    list->PushClipRect(from, to);
    if (!half.stopped.empty()) draw_away_veil();
    const Box box = draw_half(half, ids[i], model.greatest_force_n, model.shows_rate, scale);
    draw_labels(half.labels, box, scale);
    draw_ruler(half.ruler, scale);
    list->PopClipRect();
    bottom = std::max(bottom, box.bottom);
  }
  const float between = model.pair->halves[1].left;
  list->AddLine({between, 0}, {between, height}, IM_COL32(140, 178, 204, 110), 2 * scale);
  draw_banners(model, {}, {}, scale, bottom);
}

}  // namespace trocar::ui
