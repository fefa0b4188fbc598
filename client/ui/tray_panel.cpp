// The tray: which instruments there are, and which one the hand has.

#include "client/ui/hud_panels.h"
#include "client/ui/panel_style.h"

namespace trocar::ui {

void draw_tray(const HudModel& model, const Box& above, float scale, HudActions& actions) {
  const HudTray& tray = model.tray;
  ImGui::SetNextWindowPos({kMargin * scale, above.bottom + kMargin * scale});
  ImGui::Begin("tray", nullptr, model.shows_rate ? kGlass : kPanel);
  if (tray.hands > 1)
    ImGui::TextDisabled("%s hand   Tab: other", tray.hand == 0 ? "right" : "left");
  for (std::size_t i = 0; i < tray.names.size(); ++i) {
    const bool is_chosen = i == tray.chosen;
    if (model.shows_rate && !is_chosen) continue;
    const std::string digit = std::to_string((i + 1) % 10);
    const std::string key = i < 10 ? digit : i < 20 ? "Shift " + digit : " ";
    if (ImGui::Selectable((key + "  " + tray.names[i]).c_str(), is_chosen, 0, {120 * scale, 0}))
      actions.take_instrument = i;
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", tray.texts[i].c_str());
  }
  ImGui::End();
}

}  // namespace trocar::ui
