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
     {replica::Role::Instructor, "Instructor: watches, and leads the lesson"},
     {replica::Role::Observer, "Observer: watches"}}};

struct OrganText {
  const char *name, *text;
};
constexpr std::array<OrganText, 7> kOrgans{{{"liver", "Liver, of a measured material"},
                                            {"elastic-liver", "Liver, elastic: for slow machines"},
                                            {"stomach", "Stomach, hollow"},
                                            {"chest", "Chest: several organs, one on another"},
                                            {"lattice", "Block of springs"},
                                            {"plate", "Plate"},
                                            {"pegs", "Board with rings to move"}}};

template <std::size_t Size>
void set_text(std::array<char, Size>& to, const std::string& text) {
  std::snprintf(to.data(), Size, "%s", text.c_str());
}

}  // namespace

StartScreen::StartScreen(const StartChoice& preset)
    : role_(preset.role), brings_tools_(preset.brings_tools) {
  set_text(server_, preset.server);
  set_text(code_, preset.code);
  set_text(name_, preset.name);
}

StartChoice StartScreen::choice(StartDeed deed) const {
  return {.deed = deed,
          .organ = kOrgans[organ_].name,
          .task = task_,
          .is_recorded = is_recorded_,
          .recording = recording_.data(),
          .beside = beside_,
          .server = server_.data(),
          .code = code_.data(),
          .name = name_.data(),
          .role = role_,
          .brings_tools = brings_tools_ && role_ == replica::Role::Instructor};
}

void StartScreen::draw_title() {
  ImGui::SetWindowFontScale(2);
  ImGui::TextUnformatted("Trocar");
  ImGui::SetWindowFontScale(1);
  ImGui::TextDisabled(
      "Practise on soft tissue, alone or with others. For training and research, not for clinical "
      "use.");
  ImGui::Spacing();
  ImGui::Spacing();
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
  if (role_ != replica::Role::Instructor) return;
  ImGui::Indent();
  ImGui::Checkbox("and holds instruments, to show how and to take over", &brings_tools_);
  ImGui::Unindent();
}

bool StartScreen::big_button(const char* text) {
  ImGui::Spacing();
  return ImGui::Button(text, {ImGui::GetFontSize() * 11, ImGui::GetFontSize() * 2.2f});
}

void StartScreen::draw_person() {
  is_touched_ |=
      ImGui::InputTextWithHint("your name", "as others will see it", name_.data(), name_.size());
  ImGui::Spacing();
}

void StartScreen::draw_join(const StartModel& model) {
  draw_sessions(model);
  ImGui::Spacing();
  ImGui::Separator();
  ImGui::Spacing();
  is_touched_ |= ImGui::InputTextWithHint(
      "code or link", "7K3M-9QXZ-4T2B-WN8C, from the host's screen", code_.data(), code_.size());
  is_touched_ |= ImGui::InputTextWithHint("server", "HOST:PORT; a link has it", server_.data(),
                                          server_.size());
  draw_person();
  draw_role();
  if (big_button("Join")) wanted_ = StartDeed::Join;
}

void StartScreen::draw_lesson(const StartLesson& lesson) {
  ImGui::TextWrapped(
      "The lesson runs. Others find it in their list, or at %s; each role has a code:",
      lesson.address.c_str());
  ImGui::Spacing();
  for (const auto& code : lesson.codes) ImGui::BulletText("%s", code.c_str());
  ImGui::Spacing();
  if (!lesson.recording.empty())
    ImGui::TextWrapped("It is recorded in %s", lesson.recording.c_str());
  ImGui::Spacing();
  draw_person();
  draw_role();
  if (big_button("Take part")) wanted_ = StartDeed::TakePart;
  ImGui::SameLine();
  if (ImGui::Button("End the lesson", {ImGui::GetFontSize() * 11, ImGui::GetFontSize() * 2.2f}))
    wanted_ = StartDeed::EndLesson;
}

void StartScreen::draw_task(const StartModel& model) {
  const auto chosen = std::ranges::find(model.tasks, task_, &StartTask::name);
  if (ImGui::BeginCombo(
          "task", chosen == model.tasks.end() ? "None: do what you like" : chosen->title.c_str())) {
    if (ImGui::Selectable("None: do what you like", task_.empty())) task_.clear();
    for (const auto& task : model.tasks)
      if (ImGui::Selectable(task.title.c_str(), task.name == task_)) task_ = task.name;
    ImGui::EndCombo();
  }
  if (chosen == model.tasks.end()) return;
  ImGui::PushStyleColor(ImGuiCol_Text, ImGui::GetStyleColorVec4(ImGuiCol_TextDisabled));
  ImGui::TextWrapped("%s", chosen->text.c_str());
  ImGui::PopStyleColor();
}

void StartScreen::draw_own(StartDeed deed, const StartModel& model) {
  const bool is_lesson = deed == StartDeed::Host;
  if (is_lesson && model.lesson) return draw_lesson(*model.lesson);
  ImGui::TextWrapped(
      "%s", is_lesson ? "This machine becomes the server of a lesson, to which others "
                        "come over the local network. It ends with this window."
                      : "You alone with an organ, on this machine. A task has goals and points.");
  ImGui::Spacing();
  draw_task(model);
  // A task brings its organ.
  if (task_.empty() && ImGui::BeginCombo("organ", kOrgans[organ_].text)) {
    for (std::size_t i = 0; i < kOrgans.size(); ++i)
      if (ImGui::Selectable(kOrgans[i].text, i == organ_)) organ_ = i;
    ImGui::EndCombo();
  }
  ImGui::Checkbox("record it, into the current folder", &is_recorded_);
  draw_person();
  if (is_lesson) draw_role();
  ImGui::BeginDisabled(model.lesson.has_value());
  if (big_button(is_lesson ? "Open the lesson" : "Begin")) wanted_ = deed;
  ImGui::EndDisabled();
  if (model.lesson) ImGui::TextDisabled("Your lesson runs: end it first.");
}

void StartScreen::draw_recordings(const StartModel& model) {
  if (model.recordings.empty()) ImGui::TextDisabled("There is no recording in the current folder.");
  for (const auto& file : model.recordings)
    if (ImGui::Selectable(file.c_str(), file == recording_.data())) {
      set_text(recording_, file);
      is_touched_ = true;
    }
  ImGui::Spacing();
  is_touched_ |= ImGui::InputTextWithHint("file", "a recorded session, .mcap", recording_.data(),
                                          recording_.size());
  if (ImGui::BeginCombo("beside it", beside_.empty() ? "nothing" : beside_.c_str())) {
    if (ImGui::Selectable("nothing", beside_.empty())) beside_.clear();
    for (const auto& file : model.recordings)
      if (ImGui::Selectable(file.c_str(), file == beside_)) beside_ = file;
    ImGui::EndCombo();
  }
  if (big_button("Watch")) wanted_ = StartDeed::Watch;
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
  ImGui::SetCursorPos({(io.DisplaySize.x - width) / 2, io.DisplaySize.y * 0.08f});
  ImGui::BeginChild("form", {width, io.DisplaySize.y * 0.88f});
  draw_title();
  ImGui::PushItemWidth(width * 0.6f);
  wanted_.reset();
  // A lesson that has begun is what the person wants to see first.
  const bool turns_to_lesson = model.lesson && !has_turned_to_lesson_;
  has_turned_to_lesson_ = model.lesson.has_value();
  auto shown = StartDeed::Join;
  if (ImGui::BeginTabBar("deeds")) {
    const auto tab = [&](StartDeed deed, const char* title, auto&& content) {
      const bool is_turned_to = deed == StartDeed::Host && turns_to_lesson;
      const auto flags = is_turned_to ? ImGuiTabItemFlags_SetSelected : 0;
      if (!ImGui::BeginTabItem(title, nullptr, flags)) return;
      shown = deed;
      ImGui::Spacing();
      content();
      ImGui::EndTabItem();
    };
    tab(StartDeed::Join, "Join a session", [&] { draw_join(model); });
    tab(StartDeed::Practise, "Practise alone", [&] { draw_own(StartDeed::Practise, model); });
    tab(StartDeed::Host, "Host a lesson", [&] { draw_own(StartDeed::Host, model); });
    tab(StartDeed::Watch, "Watch a recording", [&] { draw_recordings(model); });
    ImGui::EndTabBar();
  }
  is_touched_ |= shown != StartDeed::Join;
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
  if (is_entered && !wanted_)
    wanted_ = shown == StartDeed::Host && model.lesson ? StartDeed::TakePart : shown;
  if (!wanted_) return std::nullopt;
  is_touched_ = true;
  return choice(*wanted_);
}

}  // namespace trocar::ui
