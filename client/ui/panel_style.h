#pragma once

// The parts of the HUD share window flags, colours, the bold font and the lines of their tables.
// Only for client/ui's own .cpp files, after <imgui.h>.

#include <imgui.h>

#include <string>

#include "client/shape/tool_mesh.h"
#include "client/ui/hud_panels.h"
#include "client/ui/palette.h"

namespace trocar::ui {

inline constexpr ImGuiWindowFlags kPanel =
    ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
    ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoFocusOnAppearing |
    ImGuiWindowFlags_NoNav;
// A panel that only informs lets the pointer through to the scene.
inline constexpr ImGuiWindowFlags kGlass = kPanel | ImGuiWindowFlags_NoInputs;
inline constexpr float kMargin = 14;
// A scale of forces goes to this at least, in N: a trembling of millinewtons is no peak.
inline constexpr float kLeastScaleNewton = 0.5f;

inline ImVec4 to_imgui(const PaletteColour& c, float alpha = 1) {
  return {c[0], c[1], c[2], alpha};
}
inline const ImVec4 kGood = to_imgui(kSkyBlue);
inline const ImVec4 kNotice = to_imgui(kYellow);
inline const ImVec4 kTrouble = to_imgui(kOrange);

inline ImVec4 to_imgui(shape::Colour c, float alpha = 1) {
  return {static_cast<float>(c.r) / 255, static_cast<float>(c.g) / 255,
          static_cast<float>(c.b) / 255, alpha};
}

inline ImFont* bold() {
  const auto& fonts = ImGui::GetIO().Fonts->Fonts;
  return fonts[fonts.Size - 1];
}

// This is where the window stands that is being drawn.
inline Box box_of_window() {
  const ImVec2 at = ImGui::GetWindowPos(), size = ImGui::GetWindowSize();
  return {at.x, at.y, at.x + size.x, at.y + size.y};
}

inline void heading(const char* text) {
  ImGui::PushFont(bold());
  ImGui::TextUnformatted(text);
  ImGui::PopFont();
}

// A line of a table of two columns.
inline void row(const char* name, const std::string& value) {
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::TextDisabled("%s", name);
  ImGui::TableNextColumn();
  ImGui::TextUnformatted(value.c_str());
}

}  // namespace trocar::ui
