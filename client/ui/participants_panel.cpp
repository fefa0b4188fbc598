// Who is here, what their tools do, and each hand's force as a small plot.

#include <imgui.h>

#include <algorithm>
#include <array>

#include "client/ui/hud_panels.h"
#include "client/ui/panel_style.h"

namespace trocar::ui {
namespace {

constexpr float kPlotWidth = 96;
constexpr std::size_t kMaxPlotPoints = 256;

void draw_dot(const HudParticipant& p, float scale) {
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const float side = ImGui::GetTextLineHeight();
  const ImVec2 centre = {at.x + side / 2, at.y + side / 2};
  const ImU32 colour = ImGui::GetColorU32(p.has_tool ? to_imgui(p.colour, p.is_silent ? 0.4f : 1.0f)
                                                     : ImVec4{0.4f, 0.47f, 0.53f, 1});
  ImDrawList* list = ImGui::GetWindowDrawList();
  if (p.has_tool)
    list->AddCircleFilled(centre, side * 0.36f, colour, 20);
  else
    list->AddCircle(centre, side * 0.30f, colour, 20, 1.5f * scale);
  ImGui::Dummy({side, side});
}

void draw_doing(const HudParticipant& p) {
  const char* doing = p.is_away                          ? "away"
                      : p.is_frozen                      ? "held still"
                      : p.is_silent                      ? "silent"
                      : p.verb == tool::Verb::None       ? replica::name_of(p.role)
                      : !p.has_claim                     ? "refused"
                      : p.is_inside                      ? "inside tissue"
                      : p.waits                          ? "held back"
                      : p.verb == tool::Verb::Grasp      ? "grasps"
                      : p.verb == tool::Verb::Cut        ? "cuts"
                      : p.form == tool::Form::Suction    ? "sucks"
                      : p.form == tool::Form::Coagulator ? "seals"
                                                         : "pushes";
  if (p.has_tool && p.verb != tool::Verb::None && !p.is_silent && !p.is_away && !p.is_frozen)
    ImGui::TextColored(p.has_claim && !p.is_inside && !p.waits
                           ? ImGui::GetStyle().Colors[ImGuiCol_Text]
                           : kTrouble,
                       "%s", doing);
  else
    ImGui::TextDisabled("%s", doing);
}

// One polyline over a base line: a few hundred vertices for eight hands.
void draw_plot(const HudParticipant& p, float greatest_n, float scale) {
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const float width = kPlotWidth * scale, height = ImGui::GetTextLineHeight();
  ImGui::Dummy({width, height});
  if (!p.has_tool || p.forces_n.size() < 2) return;
  ImDrawList* list = ImGui::GetWindowDrawList();
  const float base = at.y + height - 1 * scale;
  list->AddLine({at.x, base}, {at.x + width, base}, IM_COL32(140, 165, 180, 70), 1);
  std::array<ImVec2, kMaxPlotPoints> points;
  const std::size_t count = std::min(p.forces_n.size(), points.size());
  const std::size_t first = p.forces_n.size() - count;
  const float whole = std::max(greatest_n, kLeastScaleNewton);
  for (std::size_t i = 0; i < count; ++i) {
    const float share = std::clamp(p.forces_n[first + i] / whole, 0.0f, 1.0f);
    points[i] = {at.x + width * static_cast<float>(i) / static_cast<float>(count - 1),
                 base - share * (height - 2 * scale)};
  }
  // A joint of a steep peak would stick out above the row.
  list->PushClipRect(at, {at.x + width, at.y + height}, true);
  list->AddPolyline(points.data(), static_cast<int>(count),
                    ImGui::GetColorU32(to_imgui(p.colour, 0.95f)), 0, 1.4f * scale);
  list->PopClipRect();
}

// The figures' column is as wide as they get, so that the panel does not breathe with them. 0
// leaves it as wide as they are.
float width_of_figures(std::span<const HudParticipant> people, bool shows_rate) {
  float width = 0;
  for (const HudParticipant& p : people)
    if (p.has_tool)
      width = std::max(width,
                       ImGui::CalcTextSize(shows_rate ? p.is_self ? "00.00 N  000 mN m  000 nodes"
                                                                  : "00.00 N  000 nodes"
                                                      : "00.00 N")
                           .x);
  return width;
}

// One's own name is for research: everybody knows it.
std::string shown_name(const HudParticipant& p, bool shows_rate) {
  if (!p.is_self) return p.name;
  return shows_rate ? p.name + " (you)" : "you";
}

// Torque and nodes are figures for research.
void draw_figures(const HudParticipant& p, bool shows_all) {
  if (!p.has_tool || (p.contact_nodes == 0 && p.force_n < 0.005f)) return;
  ImGui::Text("%.2f N", static_cast<double>(p.force_n));
  if (!shows_all) return;
  ImGui::SameLine();
  if (p.is_self && p.torque_nm >= 0.5e-3f) {
    ImGui::Text("%.0f mN m", static_cast<double>(p.torque_nm) * 1e3);
    ImGui::SameLine();
  }
  ImGui::TextDisabled("%u nodes", p.contact_nodes);
}

}  // namespace

void draw_people(std::span<const HudParticipant> people, float greatest_n, bool shows_rate,
                 float scale) {
  if (ImGui::BeginTable("list", 5, ImGuiTableFlags_SizingFixedFit)) {
    for (int column = 0; column < 4; ++column) ImGui::TableSetupColumn("");
    ImGui::TableSetupColumn("", 0, width_of_figures(people, shows_rate));
    for (const HudParticipant& p : people) {
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      draw_dot(p, scale);
      ImGui::TableNextColumn();
      if (p.is_self) ImGui::PushFont(bold());
      ImGui::TextUnformatted(shown_name(p, shows_rate).c_str());
      if (p.is_self) ImGui::PopFont();
      ImGui::TableNextColumn();
      draw_doing(p);
      ImGui::TableNextColumn();
      draw_plot(p, greatest_n, scale);
      ImGui::TableNextColumn();
      draw_figures(p, shows_rate);
    }
    ImGui::EndTable();
  }
}

Box draw_participants_panel(const HudModel& model, float scale) {
  if (model.participants.empty()) return {};
  const ImVec2 screen = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({screen.x - kMargin * scale, kMargin * scale}, 0, {1, 0});
  ImGui::Begin("participants", nullptr, kGlass);
  heading("Participants");
  if (std::ranges::any_of(model.participants, &HudParticipant::has_tool)) {
    ImGui::SameLine();
    ImGui::TextDisabled("force, last 10 s, up to %.1f N",
                        static_cast<double>(std::max(model.greatest_force_n, kLeastScaleNewton)));
  }
  ImGui::Separator();
  draw_people(model.participants, model.greatest_force_n, model.shows_rate, scale);
  const Box box = box_of_window();
  ImGui::End();
  return box;
}

}  // namespace trocar::ui
