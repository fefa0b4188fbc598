// Words that stand at places of the scene: names at tools, and lengths that are measured.

#include <imgui.h>

#include "client/ui/hud_panels.h"
#include "client/ui/panel_style.h"

namespace trocar::ui {

void draw_labels(std::span<const HudLabel> labels, const Box& banners, float scale) {
  ImDrawList* list = ImGui::GetBackgroundDrawList();
  for (const HudLabel& label : labels) {
    const ImVec2 size = ImGui::CalcTextSize(label.text.c_str());
    const ImVec2 pad = {7 * scale, 3 * scale};
    ImVec2 from = {label.x + 12 * scale, label.y - size.y / 2};
    const bool is_covered =
        from.y - pad.y < banners.bottom && from.x < banners.right && from.x + size.x > banners.left;
    if (is_covered) from.y = banners.bottom + 2 * pad.y;
    list->AddRectFilled({from.x - pad.x, from.y - pad.y},
                        {from.x + size.x + pad.x, from.y + size.y + pad.y},
                        IM_COL32(8, 12, 16, 170), 6 * scale);
    list->AddRectFilled({from.x - pad.x, from.y - pad.y},
                        {from.x - pad.x + 3 * scale, from.y + size.y + pad.y},
                        ImGui::GetColorU32(to_imgui(label.colour)), 2 * scale);
    list->AddText({from.x + 2 * scale, from.y}, IM_COL32(232, 240, 245, 255), label.text.c_str());
  }
}

void draw_ruler(const HudRuler& ruler, float scale) {
  ImDrawList* list = ImGui::GetBackgroundDrawList();
  const ImU32 bright = ImGui::GetColorU32(kNotice), dark = IM_COL32(8, 12, 16, 200);
  const auto at = [&](std::size_t i) { return ImVec2{ruler.ends[i].x, ruler.ends[i].y}; };
  if (ruler.ends.size() == 2) {
    list->AddLine(at(0), at(1), dark, 4 * scale);
    list->AddLine(at(0), at(1), bright, 2 * scale);
  }
  for (std::size_t i = 0; i < ruler.ends.size(); ++i) {
    list->AddCircleFilled(at(i), 5 * scale, dark, 20);
    list->AddCircleFilled(at(i), 3.5f * scale, bright, 20);
  }
  if (ruler.ends.size() != 2 || ruler.text.empty()) return;
  const ImVec2 size = ImGui::CalcTextSize(ruler.text.c_str());
  const ImVec2 pad = {7 * scale, 3 * scale};
  const ImVec2 from = {(at(0).x + at(1).x - size.x) / 2,
                       (at(0).y + at(1).y) / 2 - size.y - 12 * scale};
  list->AddRectFilled({from.x - pad.x, from.y - pad.y},
                      {from.x + size.x + pad.x, from.y + size.y + pad.y}, dark, 6 * scale);
  list->AddText(from, bright, ruler.text.c_str());
}

}  // namespace trocar::ui
