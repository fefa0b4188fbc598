// The tray: which instruments there are, and which one the hand has.

#include "client/ui/hud_panels.h"
#include "client/ui/panel_style.h"

namespace trocar::ui {

void draw_tray(const HudTray& tray, float scale, HudActions& actions) {
  const ImVec2 screen = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({kMargin * scale, 0.52f * screen.y}, 0, {0, 0.5f});
  ImGui::Begin("tray", nullptr, kPanel);
  if (tray.hands > 1)
    ImGui::TextDisabled("%s hand   Tab: other", tray.hand == 0 ? "right" : "left");
  for (std::size_t i = 0; i < tray.names.size(); ++i) {
    const bool is_chosen = i == tray.chosen;
    const std::string key = i < 9 ? std::to_string(i + 1) : " ";
    if (ImGui::Selectable((key + "  " + tray.names[i]).c_str(), is_chosen, 0, {120 * scale, 0}))
      actions.take_instrument = i;
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", tray.texts[i].c_str());
  }
  ImGui::End();
}

}  // namespace trocar::ui
