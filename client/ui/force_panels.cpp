// The panels show what one's own tools and hands feel: a bar for everybody, and for whoever looks
// closer what each device renders beside what the server says.

#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "client/ui/hud_panels.h"
#include "client/ui/panel_style.h"

namespace trocar::ui {
namespace {

constexpr float kBarWidth = 330, kBarHeight = 15;
constexpr float kCurveWidth = 300, kCurveHeight = 54;

// The least of 0.5, 1, 2, 5, 10, ... N that the force fits into.
float whole_newtons(float force_n) {
  float whole = kLeastScaleNewton;
  for (const float step : {1.0f, 2.0f, 5.0f, 10.0f, 20.0f, 50.0f, 100.0f})
    if (force_n > whole) whole = step;
  return whole;
}

void draw_bar(const HudOwnForce& own, float peak_n, float whole_n, float scale) {
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const float width = kBarWidth * scale, height = kBarHeight * scale;
  ImGui::Dummy({width, height});
  ImDrawList* list = ImGui::GetWindowDrawList();
  const auto x_of = [&](float force_n) {
    return at.x + width * std::clamp(force_n / whole_n, 0.0f, 1.0f);
  };
  list->AddRectFilled(at, {at.x + width, at.y + height}, IM_COL32(40, 53, 66, 190), 3 * scale);
  list->AddRectFilled(at, {x_of(own.force_n), at.y + height},
                      ImGui::GetColorU32(to_imgui(own.colour, 0.95f)), 3 * scale);
  for (int part = 1; part < 5; ++part) {
    const float x = x_of(whole_n * static_cast<float>(part) / 5);
    list->AddLine({x, at.y + height * 0.6f}, {x, at.y + height}, IM_COL32(200, 215, 225, 110), 1);
  }
  const float peak = x_of(peak_n);
  if (peak_n > 0)
    list->AddLine({peak, at.y}, {peak, at.y + height}, IM_COL32(255, 255, 255, 220), 2 * scale);
}

void draw_curve(std::span<const float> forces_n, float whole_n, ImVec2 at, float scale,
                ImU32 colour) {
  std::array<ImVec2, kFeltBins> points;
  const std::size_t count = std::min(forces_n.size(), points.size());
  if (count < 2) return;
  const float height = kCurveHeight * scale;
  for (std::size_t i = 0; i < count; ++i)
    points[i] = {at.x + kCurveWidth * scale * static_cast<float>(i) / static_cast<float>(count - 1),
                 at.y + height - std::clamp(forces_n[i] / whole_n, 0.0f, 1.0f) * (height - 2)};
  ImGui::GetWindowDrawList()->AddPolyline(points.data(), static_cast<int>(count), colour, 0,
                                          1.5f * scale);
}

void draw_curves(const HudFeltHand& hand, float scale) {
  const auto greatest = [](const auto& forces) {
    return forces.empty() ? 0.0f : *std::ranges::max_element(forces);
  };
  const float whole_n = whole_newtons(std::max(greatest(hand.hand_n), greatest(hand.server_n)));
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const ImVec2 end{at.x + kCurveWidth * scale, at.y + kCurveHeight * scale};
  ImGui::Dummy({kCurveWidth * scale, kCurveHeight * scale});
  ImDrawList* list = ImGui::GetWindowDrawList();
  list->AddRectFilled(at, end, IM_COL32(20, 27, 34, 190), 3 * scale);
  list->PushClipRect(at, end, true);
  draw_curve(hand.server_n, whole_n, at, scale, IM_COL32(235, 240, 245, 210));
  draw_curve(hand.hand_n, whole_n, at, scale, ImGui::GetColorU32(kNotice));
  list->PopClipRect();
  ImGui::TextColored(kNotice, "in the hand");
  ImGui::SameLine();
  ImGui::TextUnformatted("by the server");
  ImGui::SameLine();
  ImGui::TextDisabled("last 10 s, up to %g N", static_cast<double>(whole_n));
}

}  // namespace

void draw_own_forces(const HudModel& model, float scale) {
  if (model.own_forces.empty()) return;
  const ImVec2 screen = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({kMargin * scale, screen.y - kMargin * scale}, 0, {0, 1});
  ImGui::Begin("own forces", nullptr, kGlass);
  float most_n = model.own_peak_n;
  for (const auto& own : model.own_forces) most_n = std::max(most_n, own.force_n);
  const float whole_n = whole_newtons(most_n);
  for (const auto& own : model.own_forces) {
    ImGui::TextDisabled("%s", own.name.c_str());
    ImGui::SameLine();
    char force[24];
    std::snprintf(force, sizeof force, "%.2f N", static_cast<double>(own.force_n));
    ImGui::PushFont(bold());
    ImGui::TextUnformatted(force);
    ImGui::PopFont();
    ImGui::SameLine();
    ImGui::TextDisabled("at most %.2f N in 10 s, bar to %g N",
                        static_cast<double>(model.own_peak_n), static_cast<double>(whole_n));
    draw_bar(own, model.own_peak_n, whole_n, scale);
  }
  ImGui::End();
}

void draw_felt_hands(const HudModel& model, float top, float scale) {
  if (!model.shows_rate || model.felt_hands.empty()) return;
  const ImVec2 screen = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({screen.x - kMargin * scale, top + kMargin * scale}, 0, {1, 0});
  ImGui::Begin("felt hands", nullptr, kGlass);
  int number = 0;
  for (const auto& hand : model.felt_hands) {
    const FeltHandText said = describe(hand.figures);
    ImGui::PushID(number++);
    heading(hand.figures.device.c_str());
    if (ImGui::BeginTable("figures", 2, ImGuiTableFlags_SizingFixedFit)) {
      row("loop", said.loop);
      row("wakes late", said.lateness);
      row("answers", said.answers);
      row("force", said.force);
      row("scale", said.scale);
      row("safeguards", said.safeguards);
      ImGui::EndTable();
    }
    draw_curves(hand, scale);
    ImGui::PopID();
  }
  ImGui::End();
}

}  // namespace trocar::ui
