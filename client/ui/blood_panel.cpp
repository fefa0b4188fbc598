// Blood: how much is lost, how fast it runs, and where it has gone.

#include "client/ui/hud_panels.h"
#include "client/ui/panel_style.h"

namespace trocar::ui {
namespace {

std::string millilitres(std::uint64_t nl) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f ml", static_cast<double>(nl) * 1e-6);
  return text;
}

}  // namespace

Box draw_blood(const wire::BloodFigures& blood, const Box& above, float scale) {
  const ImVec2 screen = ImGui::GetIO().DisplaySize;
  const float width = above.right > 0 ? above.right - above.left : 300 * scale;
  ImGui::SetNextWindowPos({screen.x - kMargin * scale, above.bottom + kMargin * scale}, 0, {1, 0});
  ImGui::SetNextWindowSizeConstraints({width, 0}, {width, 2000 * scale});
  ImGui::Begin("blood", nullptr, kGlass);
  heading(("Blood lost: " + millilitres(blood.shed_nl)).c_str());
  char text[64];
  const double per_minute = static_cast<double>(blood.rate_nl_s) * 60e-6;
  if (blood.open_vessels > 0) {
    std::snprintf(text, sizeof text, "a vessel bleeds, %.0f ml/min", per_minute);
    ImGui::TextColored(kTrouble, "%s", text);
  } else {
    std::snprintf(text, sizeof text, blood.rate_nl_s > 0 ? "now %.1f ml/min" : "nothing bleeds",
                  per_minute);
    ImGui::TextUnformatted(text);
  }
  ImGui::TextDisabled("sucked off %s, on the organ %s", millilitres(blood.sucked_nl).c_str(),
                      millilitres(blood.on_surface_nl).c_str());
  Box box = box_of_window();
  ImGui::End();
  box.top = above.top;
  return box;
}

}  // namespace trocar::ui
