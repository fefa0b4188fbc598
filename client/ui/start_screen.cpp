#include "client/ui/start_screen.h"

#include <imgui.h>

#include <algorithm>
#include <cstdio>

#include "client/ui/panel_style.h"

namespace trocar::ui {
namespace {

struct RoleText {
  replica::Role role;
  const char* text;
};
constexpr std::array<RoleText, 4> kRoleTexts{
    {{replica::Role::Surgeon, "Surgeon: holds instruments"},
     {replica::Role::Assistant, "Assistant: holds instruments"},
     {replica::Role::Instructor, "Instructor: watches, marks and returns the organ"},
     {replica::Role::Observer, "Observer: watches"}}};

template <std::size_t Size>
void set_text(std::array<char, Size>& to, const std::string& text) {
  std::snprintf(to.data(), Size, "%s", text.c_str());
}

}  // namespace

StartScreen::StartScreen(const StartChoice& preset) : role_(preset.role) {
  set_text(server_, preset.server);
  set_text(code_, preset.code);
  set_text(name_, preset.name);
}

StartChoice StartScreen::choice() const {
  return {server_.data(), code_.data(), name_.data(), role_};
}

void StartScreen::draw_sessions(const StartModel& model) {
  if (model.sessions.empty()) {
    ImGui::PushStyleColor(ImGuiCol_Text, ImGui::GetStyleColorVec4(ImGuiCol_TextDisabled));
    ImGui::TextWrapped("%s", model.no_sessions_text.empty() ? "Looking for sessions ..."
                                                            : model.no_sessions_text.c_str());
    ImGui::PopStyleColor();
    return;
  }
  const auto flags = ImGuiTableFlags_RowBg | ImGuiTableFlags_SizingStretchProp;
  if (!ImGui::BeginTable("sessions", 4, flags)) return;
  for (const char* title : {"session", "organ", "people", "address"})
    ImGui::TableSetupColumn(title);
  ImGui::TableHeadersRow();
  for (const auto& session : model.sessions) {
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    ImGui::PushID(session.server.c_str());
    if (ImGui::Selectable(session.name.c_str(), session.server == server_.data(),
                          ImGuiSelectableFlags_SpanAllColumns)) {
      set_text(server_, session.server);
      is_touched_ = true;
    }
    ImGui::PopID();
    ImGui::TableNextColumn();
    ImGui::TextUnformatted(session.organ.c_str());
    ImGui::TableNextColumn();
    if (session.people > 0) ImGui::Text("%d", session.people);
    ImGui::TableNextColumn();
    ImGui::Text("%s%s", session.server.c_str(), session.needs_code ? "" : " (no code needed)");
  }
  ImGui::EndTable();
}

void StartScreen::draw_role() {
  for (const auto& known : kRoleTexts)
    if (ImGui::RadioButton(known.text, role_ == known.role)) {
      role_ = known.role;
      is_touched_ = true;
    }
}

std::optional<StartChoice> StartScreen::draw(const StartModel& model, bool is_entered) {
  const ImGuiIO& io = ImGui::GetIO();
  ImGui::SetNextWindowPos({0, 0});
  ImGui::SetNextWindowSize(io.DisplaySize);
  ImGui::SetNextWindowBgAlpha(1);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0);
  ImGui::Begin("start", nullptr, kPanel & ~ImGuiWindowFlags_AlwaysAutoResize);
  ImGui::PopStyleVar();
  const float width = std::min(io.DisplaySize.x - 2 * kMargin, ImGui::GetFontSize() * 46);
  ImGui::SetCursorPos({(io.DisplaySize.x - width) / 2, io.DisplaySize.y * 0.1f});
  ImGui::BeginChild("form", {width, io.DisplaySize.y * 0.85f});
  ImGui::PushItemWidth(width * 0.6f);
  heading("Join a session");
  ImGui::Spacing();
  draw_sessions(model);
  ImGui::Spacing();
  ImGui::Separator();
  ImGui::Spacing();
  const auto field = [&](const char* label, const char* hint, auto& text) {
    is_touched_ |= ImGui::InputTextWithHint(label, hint, text.data(), text.size());
  };
  field("code or link", "7K3M-9QXZ-4T2B-WN8C, from the host's screen", code_);
  field("server", "HOST:PORT; a link has it", server_);
  field("your name", "as others will see it", name_);
  ImGui::Spacing();
  draw_role();
  ImGui::Spacing();
  const bool is_clicked =
      ImGui::Button("Join", {ImGui::GetFontSize() * 9, ImGui::GetFontSize() * 2.2f});
  if (!model.message.empty()) {
    ImGui::Spacing();
    ImGui::PushStyleColor(ImGuiCol_Text, kTrouble);
    ImGui::TextWrapped("%s", model.message.c_str());
    ImGui::PopStyleColor();
  }
  ImGui::PopItemWidth();
  ImGui::EndChild();
  ImGui::End();
  ImGui::Render();
  if (!is_clicked && !is_entered) return std::nullopt;
  is_touched_ = true;
  return choice();
}

}  // namespace trocar::ui
