// The time bar of a recording: what happened when, the greatest force under it, and the speed.

#include <imgui.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "client/ui/hud_panels.h"
#include "client/ui/panel_style.h"

namespace trocar::ui {
namespace {

using Kind = replica::PlaybackEventKind;

constexpr float kCurveHeight = 26, kMarkHeight = 9, kReach = 4;  // pixels of the design
constexpr std::array<float, 5> kSpeeds{0.1f, 0.25f, 1, 4, 16};
constexpr float kSpeedWidth = 46, kMeasureWidth = 74, kChoiceWidth = 118;
constexpr double kJustPassedSeconds = 1;

ImVec4 colour_of(Kind kind) {
  switch (kind) {
    case Kind::Refusal:
    case Kind::Gap:
      return kTrouble;
    case Kind::Cut:
    case Kind::Lesson:
      return kNotice;
    case Kind::Grasp:
    case Kind::Person:
      break;
  }
  return kGood;
}

double seconds_of(const replica::PlaybackEvent& event) {
  return static_cast<double>(event.tick) / kTicksPerSecond;
}

// A button that is drawn as pressed while it is on.
bool pressed_button(const char* name, float width, bool is_on) {
  if (is_on)
    ImGui::PushStyleColor(ImGuiCol_Button, ImGui::GetStyle().Colors[ImGuiCol_ButtonActive]);
  const bool is_clicked = ImGui::Button(name, {width, 0});
  if (is_on) ImGui::PopStyleColor();
  return is_clicked;
}

// Draws the story under the slider, from `left` and `width` wide. Returns the event to tell: the
// one under the pointer, else the last one there was.
const replica::PlaybackEvent* draw_story(const HudTimeline& timeline, float left, float width,
                                         float scale) {
  ImDrawList* list = ImGui::GetWindowDrawList();
  const ImVec2 at = {left, ImGui::GetCursorScreenPos().y};
  const float height = (kCurveHeight + kMarkHeight) * scale;
  ImGui::Dummy({width, height});
  const float base = at.y + height;
  list->AddRectFilled(at, {left + width, base}, IM_COL32(20, 27, 34, 190), 3 * scale);
  if (timeline.story == nullptr) {
    list->AddText({left + 6 * scale, at.y + 8 * scale}, ImGui::GetColorU32(ImGuiCol_TextDisabled),
                  "Looking for events ...");
    return nullptr;
  }
  const double span = std::max(timeline.last_seconds - timeline.first_seconds, 1e-3);
  const auto x_of = [&](double seconds) {
    const double share = (seconds - timeline.first_seconds) / span;
    return left + width * static_cast<float>(std::clamp(share, 0.0, 1.0));
  };
  const auto& forces = timeline.story->forces_n;
  const float most =
      forces.empty() ? 0 : std::max(*std::ranges::max_element(forces), kLeastScaleNewton);
  for (std::size_t i = 0; i < forces.size() && most > 0; ++i) {
    const double seconds =
        timeline.last_seconds * static_cast<double>(i) / static_cast<double>(forces.size() - 1);
    const float x = x_of(seconds);
    list->AddLine({x, base}, {x, base - forces[i] / most * kCurveHeight * scale},
                  IM_COL32(150, 175, 190, 150),
                  std::max(1.0f, width / static_cast<float>(forces.size())));
  }
  const replica::PlaybackEvent *last = nullptr, *pointed = nullptr;
  const ImVec2 mouse = ImGui::GetIO().MousePos;
  float nearest = kReach * scale;
  for (const auto& event : timeline.story->events) {
    const float x = x_of(seconds_of(event));
    list->AddLine({x, at.y}, {x, at.y + kMarkHeight * scale},
                  ImGui::GetColorU32(colour_of(event.kind)), 2 * scale);
    if (seconds_of(event) <= timeline.position_seconds + 1e-6) last = &event;
    const bool is_level = mouse.y >= at.y && mouse.y <= base;
    if (const float away = std::abs(mouse.x - x); is_level && away <= nearest) {
      nearest = away;
      pointed = &event;
    }
  }
  const float now = x_of(timeline.position_seconds);
  list->AddLine({now, at.y}, {now, base}, IM_COL32(255, 255, 255, 220), scale);
  char text[48];
  std::snprintf(text, sizeof text, "force, up to %.1f N", static_cast<double>(most));
  const ImVec2 size = ImGui::CalcTextSize(text);
  list->AddText({left + width + 6 * scale, base - size.y - 2 * scale},
                ImGui::GetColorU32(ImGuiCol_TextDisabled), text);
  return pointed != nullptr ? pointed : last;
}

void draw_pair_choices(const HudPair& pair, float scale, HudActions& actions) {
  const bool has_stages = pair.has_stages.value_or(false);
  if (has_stages) {
    if (pressed_button("From the start", kChoiceWidth * scale, !pair.is_by_stage) &&
        pair.is_by_stage)
      actions.toggle_alignment = true;
    ImGui::SameLine();
    if (pressed_button("Stage by stage", kChoiceWidth * scale, pair.is_by_stage) &&
        !pair.is_by_stage)
      actions.toggle_alignment = true;
    ImGui::SameLine();
  }
  if (pressed_button("Own views", kChoiceWidth * scale, pair.has_own_views))
    actions.toggle_own_views = true;
  if (has_stages || !pair.has_stages) return;
  ImGui::SameLine();
  ImGui::TextDisabled("They have no stages of a lesson in common: both run from their start.");
}

}  // namespace

std::optional<double> event_beside(const HudTimeline& timeline, bool is_next) {
  if (timeline.story == nullptr) return std::nullopt;
  const double slack = !is_next && timeline.is_playing ? kJustPassedSeconds : 5e-4;
  std::optional<double> before;
  for (const auto& event : timeline.story->events) {
    const double at = seconds_of(event);
    if (is_next && at > timeline.position_seconds + slack && at <= timeline.last_seconds) return at;
    if (!is_next && at < timeline.position_seconds - slack) before = at;
  }
  return before;
}

Box draw_timeline(const HudModel& model, float scale, HudActions& actions) {
  const HudTimeline& timeline = *model.timeline;
  const ImVec2 screen = ImGui::GetIO().DisplaySize;
  const float width = std::min(screen.x - 2 * kMargin * scale, 900 * scale);
  ImGui::SetNextWindowPos({screen.x / 2, screen.y - kMargin * scale}, 0, {0.5f, 1});
  ImGui::SetNextWindowSize({width, 0});
  ImGui::Begin("timeline", nullptr, kPanel & ~ImGuiWindowFlags_AlwaysAutoResize);
  if (ImGui::Button(timeline.is_playing ? "Pause" : "Play", {70 * scale, 0}))
    actions.toggle_play = true;
  ImGui::SameLine();
  auto position = static_cast<float>(timeline.position_seconds);
  const std::string text =
      clock_text(timeline.position_seconds) + " / " + clock_text(timeline.last_seconds);
  const float left = ImGui::GetCursorScreenPos().x;
  const float gap = ImGui::GetStyle().ItemSpacing.x;
  const float bar = ImGui::GetContentRegionAvail().x -
                    static_cast<float>(kSpeeds.size()) * (kSpeedWidth * scale + gap) -
                    kMeasureWidth * scale - gap;
  ImGui::SetNextItemWidth(bar);
  if (ImGui::SliderFloat("##seek", &position, static_cast<float>(timeline.first_seconds),
                         static_cast<float>(timeline.last_seconds), text.c_str(),
                         ImGuiSliderFlags_AlwaysClamp | ImGuiSliderFlags_NoInput))
    actions.seek_seconds = position;
  for (const float speed : kSpeeds) {
    ImGui::SameLine();
    char name[16];
    std::snprintf(name, sizeof name, "%gx", static_cast<double>(speed));
    if (pressed_button(name, kSpeedWidth * scale, timeline.speed == speed)) actions.speed = speed;
  }
  ImGui::SameLine();
  if (pressed_button("Measure", kMeasureWidth * scale, timeline.is_measuring))
    actions.toggle_measure = true;
  const auto* told = draw_story(timeline, left, bar, scale);
  if (told != nullptr)
    ImGui::TextColored(colour_of(told->kind), "%s  %s", clock_text(seconds_of(*told)).c_str(),
                       told->text.c_str());
  else
    ImGui::TextDisabled("Page Up and Page Down go from event to event.");
  if (model.pair) draw_pair_choices(*model.pair, scale, actions);
  const Box box = box_of_window();
  ImGui::End();
  return box;
}

}  // namespace trocar::ui
