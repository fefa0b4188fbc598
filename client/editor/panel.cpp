#include "client/editor/panel.h"

#include <imgui.h>

#include <algorithm>

#include "client/editor/organ_view.h"
#include "client/shape/tool_mesh.h"
#include "client/ui/palette.h"

namespace trocar::editor {
namespace {

constexpr ImGuiWindowFlags kFlags =
    ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings;

ImVec4 colour_of(const ui::PaletteColour& c) {
  return {c[0], c[1], c[2], 1};
}
ImVec4 colour_of(shape::Colour c) {
  return {static_cast<float>(c.r) / 255, static_cast<float>(c.g) / 255,
          static_cast<float>(c.b) / 255, 1};
}

void heading(const char* text) {
  ImGui::Spacing();
  ImGui::Separator();
  ImGui::PushFont(ImGui::GetIO().Fonts->Fonts.back());
  ImGui::TextUnformatted(text);
  ImGui::PopFont();
}

void wrapped(const std::string& text, const ImVec4& colour) {
  ImGui::PushStyleColor(ImGuiCol_Text, colour);
  ImGui::TextWrapped("%s", text.c_str());
  ImGui::PopStyleColor();
}

void patch(const ImVec4& colour) {
  const float side = ImGui::GetFontSize() * 0.8f;
  ImGui::ColorButton("##patch", colour,
                     ImGuiColorEditFlags_NoTooltip | ImGuiColorEditFlags_NoDragDrop, {side, side});
  ImGui::SameLine();
}

// A button that is grey where it would do nothing.
bool button(const char* text, bool can_be_pressed = true) {
  ImGui::BeginDisabled(!can_be_pressed);
  const bool is_pressed = ImGui::Button(text);
  ImGui::EndDisabled();
  return is_pressed;
}

void draw_figures(const PanelFigures& figures) {
  ImGui::PushFont(ImGui::GetIO().Fonts->Fonts.back());
  ImGui::TextUnformatted(figures.name.c_str());
  ImGui::PopFont();
  ImGui::PushStyleColor(ImGuiCol_Text, ImGui::GetStyleColorVec4(ImGuiCol_TextDisabled));
  ImGui::TextWrapped("%s", figures.source.c_str());
  ImGui::PopStyleColor();
  if (!ImGui::BeginTable("figures", 2, ImGuiTableFlags_SizingFixedFit)) return;
  for (const auto& [name, value] : figures.rows) {
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    ImGui::TextDisabled("%s", name.c_str());
    ImGui::TableNextColumn();
    ImGui::TextUnformatted(value.c_str());
  }
  ImGui::EndTable();
}

void draw_modes(PanelState& state) {
  heading("Left button");
  const auto mode = [&](const char* text, Mode value) {
    if (ImGui::RadioButton(text, state.mode == value)) state.mode = value;
  };
  mode("1  does nothing", Mode::Look);
  mode("2  holds nodes, with Shift lets go", Mode::Hold);
  mode("3  paints a region, with Shift takes away", Mode::Region);
  mode("4  presses, the wheel goes deeper", Mode::Press);
  if (state.mode == Mode::Hold || state.mode == Mode::Region)
    ImGui::SliderFloat("radius", &state.brush_mm, kLeastBrush_mm, kMostBrush_mm, "%.1f mm",
                       ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_AlwaysClamp);
  if (state.mode == Mode::Region)
    ImGui::SliderFloat("depth", &state.paint_depth_mm, 0, kMostPaintDepth_mm, "%.1f mm",
                       ImGuiSliderFlags_AlwaysClamp);
}

void draw_box(PanelState& state, PanelActions& actions) {
  heading("In numbers, mm from the centre");
  ImGui::InputFloat3("from", state.low_mm.data(), "%.1f");
  ImGui::InputFloat3("to", state.high_mm.data(), "%.1f");
  for (auto* bounds : {&state.low_mm, &state.high_mm})
    for (float& bound : *bounds) bound = std::clamp(bound, -2000.0f, 2000.0f);
  if (state.mode == Mode::Region) {
    actions.paint_box = button("Into the region");
    ImGui::SameLine();
    actions.unpaint_box = button("Out of it", state.region.has_value());
    return;
  }
  ImGui::Checkbox("surface alone", &state.is_on_surface);
  actions.hold_box = button("Hold these");
  ImGui::SameLine();
  actions.release_box = button("Let go of these");
  ImGui::SameLine();
  actions.hold_none = button("Let go of all");
}

void draw_regions(const edit::Editor& editor, const PanelFigures& figures, PanelState& state,
                  PanelActions& actions) {
  const auto& regions = editor.organ().regions;
  heading("Regions");
  for (std::size_t r = 0; r < regions.size(); ++r) {
    ImGui::PushID(static_cast<int>(r));
    patch(colour_of(shape::colour_of_slot(colour_of_part(r))));
    if (ImGui::RadioButton(regions[r].name.c_str(), state.region == r)) {
      state.region = r;
      state.part = r;
    }
    ImGui::SameLine();
    ImGui::TextDisabled("%zu %s", figures.part_elements[r + 1], figures.element);
    ImGui::PopID();
  }
  if (ImGui::RadioButton("a new one", !state.region)) state.region.reset();
  ImGui::SetNextItemWidth(-1);
  ImGui::InputTextWithHint("##name", state.region ? "another name" : "its name",
                           state.new_name.data(), state.new_name.size());
  if (!state.region) return;
  actions.rename_region = button("Rename", state.new_name[0] != 0);
  ImGui::SameLine();
  actions.raise_region = button("Over the others", *state.region + 1 < regions.size());
  ImGui::SameLine();
  actions.remove_region = button("Remove");
}

void draw_material(const edit::Editor& editor, const PanelFigures& figures,
                   std::span<const material::HyperelasticMaterial> materials, PanelState& state,
                   PanelActions& actions) {
  heading("Material");
  const auto& regions = editor.organ().regions;
  const auto name_of = [&](const edit::Part& part) {
    return part ? regions[*part].name : std::string("the organ's own");
  };
  const auto before = [](const char* text) {
    ImGui::AlignTextToFramePadding();
    ImGui::TextDisabled("%s", text);
    ImGui::SameLine(ImGui::GetFontSize() * 5);
  };
  before("of");
  ImGui::SetNextItemWidth(-1);
  if (ImGui::BeginCombo("##part", name_of(state.part).c_str())) {
    for (std::size_t p = 0; p <= regions.size(); ++p) {
      const edit::Part part = p == 0 ? edit::Part{} : edit::Part{p - 1};
      ImGui::PushID(static_cast<int>(p));
      if (ImGui::Selectable(name_of(part).c_str(), part == state.part)) state.part = part;
      ImGui::PopID();
    }
    ImGui::EndCombo();
  }
  before("is now");
  ImGui::TextUnformatted(figures.part_materials[state.part ? *state.part + 1 : 0].c_str());
  const bool is_measured = state.choice < materials.size();
  const char* kByHand = "neo-Hookean, by hand";
  before("becomes");
  ImGui::SetNextItemWidth(-1);
  if (ImGui::BeginCombo("##material",
                        is_measured ? materials[state.choice].name.c_str() : kByHand)) {
    for (std::size_t m = 0; m < materials.size(); ++m)
      if (ImGui::Selectable(materials[m].name.c_str(), m == state.choice)) state.choice = m;
    if (ImGui::Selectable(kByHand, !is_measured)) state.choice = materials.size();
    ImGui::EndCombo();
  }
  ImGui::PushStyleColor(ImGuiCol_Text, ImGui::GetStyleColorVec4(ImGuiCol_TextDisabled));
  ImGui::TextWrapped("%s", is_measured ? materials[state.choice].source.c_str()
                                       : "Poisson's ratio 0.45. Chosen by you, not measured.");
  ImGui::PopStyleColor();
  if (!is_measured)
    ImGui::SliderFloat("Young's modulus", &state.young_modulus_kpa, 0.1f, 1000, "%.2f kPa",
                       ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_AlwaysClamp);
  actions.use_material = button("Make it of this", !editor.organ().mesh.tets.empty());
}

void draw_press(const PressFigures& press, PanelState& state) {
  heading("Press");
  ImGui::SliderFloat("tip's radius", &state.tip_mm, kLeastTip_mm, kMostTip_mm, "%.1f mm",
                     ImGuiSliderFlags_AlwaysClamp);
  ImGui::SliderFloat("goes in", &state.press_mm, kLeastPress_mm, kMostPress_mm, "%.1f mm",
                     ImGuiSliderFlags_AlwaysClamp);
  ImGui::Text("%.3f N at %.2f mm", static_cast<double>(press.force_n),
              static_cast<double>(press.depth_mm));
  ImGui::SameLine();
  ImGui::TextDisabled("most %.3f N", static_cast<double>(press.most_n));
  ImGui::PlotLines("##force", press.forces_n.data(), static_cast<int>(press.forces_n.size()), 0,
                   nullptr, 0, std::max(press.most_n * 1.1f, 0.05f),
                   {ImGui::GetContentRegionAvail().x, ImGui::GetFontSize() * 6});
  if (press.share < 0.95f)
    ImGui::TextDisabled("force over time, at %.0f %% of its pace",
                        static_cast<double>(press.share) * 100);
  else
    ImGui::TextDisabled("force over time");
}

void draw_saving(const edit::Editor& editor, const PanelFigures& figures, PanelState& state,
                 PanelActions& actions) {
  heading("File");
  actions.undo = button("Undo", editor.can_undo());
  ImGui::SameLine();
  actions.redo = button("Redo", editor.can_redo());
  ImGui::SameLine();
  actions.save = button("Save");
  ImGui::SameLine();
  ImGui::TextDisabled("%s", editor.has_unsaved_changes() ? "not saved" : "");
  ImGui::SetNextItemWidth(-1);
  ImGui::InputText("##file", state.file.data(), state.file.size());
  // Its line is there without words, too, so that nothing moves under the pointer.
  wrapped(state.message.empty() ? " " : state.message,
          colour_of(state.is_trouble ? ui::kOrange : ui::kSkyBlue));
  for (const auto& remark : figures.remarks) wrapped(remark, colour_of(ui::kYellow));
}

void draw_questions(PanelState& state, PanelActions& actions) {
  if (state.asks_to_replace) ImGui::OpenPopup("Replace?");
  if (state.asks_to_close) ImGui::OpenPopup("Not saved");
  state.asks_to_replace = state.asks_to_close = false;
  constexpr auto kPopup = ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoSavedSettings;
  if (ImGui::BeginPopupModal("Replace?", nullptr, kPopup)) {
    ImGui::Text("%s is there already.", state.file.data());
    actions.replace = ImGui::Button("Replace it");
    ImGui::SameLine();
    const bool keeps = ImGui::Button("Keep it");
    if (keeps) state.closes_when_saved = false;
    if (keeps || actions.replace) ImGui::CloseCurrentPopup();
    ImGui::EndPopup();
  }
  if (ImGui::BeginPopupModal("Not saved", nullptr, kPopup)) {
    ImGui::TextUnformatted("What you changed is not saved.");
    if (ImGui::Button("Save it")) actions.save = state.closes_when_saved = true;
    ImGui::SameLine();
    actions.close = ImGui::Button("Leave without it");
    ImGui::SameLine();
    if (ImGui::Button("Stay") || actions.close || actions.save) ImGui::CloseCurrentPopup();
    ImGui::EndPopup();
  }
}

}  // namespace

PanelActions draw_panel(const edit::Editor& editor, const PanelFigures& figures,
                        const PressFigures& press,
                        std::span<const material::HyperelasticMaterial> materials, float width,
                        PanelState& state) {
  PanelActions actions;
  ImGui::SetNextWindowPos({0, 0});
  ImGui::SetNextWindowSize({width, ImGui::GetIO().DisplaySize.y});
  ImGui::SetNextWindowBgAlpha(1);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0);
  ImGui::Begin("panel", nullptr, kFlags & ~ImGuiWindowFlags_NoScrollbar);
  ImGui::PopStyleVar();
  ImGui::PushItemWidth(width * 0.52f);
  draw_figures(figures);
  draw_saving(editor, figures, state, actions);
  draw_modes(state);
  if (state.mode == Mode::Region) {
    draw_regions(editor, figures, state, actions);
    draw_box(state, actions);
    draw_material(editor, figures, materials, state, actions);
  } else if (state.mode == Mode::Hold) {
    draw_box(state, actions);
  } else if (state.mode == Mode::Press) {
    draw_press(press, state);
    draw_material(editor, figures, materials, state, actions);
  }
  heading("Colours");
  ImGui::Checkbox("##held", &state.shows_held);
  ImGui::SameLine();
  patch(colour_of(shape::colour_of_slot(kHeldColour)));
  ImGui::TextUnformatted("held nodes");
  ImGui::Checkbox("regions", &state.shows_regions);
  if (!editor.organ().fine_surface.empty()) {
    ImGui::Checkbox("F  fine surface", &state.wants_fine);
    if (state.wants_fine && !state.shows_fine()) {
      ImGui::SameLine();
      ImGui::TextDisabled("not while painting");
    }
  }
  ImGui::PopItemWidth();
  ImGui::End();
  draw_questions(state, actions);
  return actions;
}

void draw_ring(std::span<const std::array<float, 2>> pixels, bool takes_away) {
  std::vector<ImVec2> points;
  const ImVec2 scale = ImGui::GetIO().DisplayFramebufferScale;
  for (const auto& [x, y] : pixels) points.push_back({x / scale.x, y / scale.y});
  ImGui::GetBackgroundDrawList()->AddPolyline(
      points.data(), static_cast<int>(points.size()),
      ImGui::GetColorU32(colour_of(takes_away ? ui::kOrange : ui::kSkyBlue)), ImDrawFlags_Closed,
      2);
}

}  // namespace trocar::editor
