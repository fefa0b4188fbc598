#include "client/ui/hud_panels.h"

#include <imgui.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <utility>

#include "client/ui/banner_text.h"
#include "client/ui/panel_style.h"

namespace trocar::ui {
namespace {

std::string format(const char* pattern, ...) __attribute__((format(printf, 1, 2)));
std::string format(const char* pattern, ...) {
  char text[160];
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(text, sizeof text, pattern, arguments);
  va_end(arguments);
  return text;
}

ImVec4 colour_of(RateTone tone) {
  return tone == RateTone::Calm ? kGood : tone == RateTone::Notice ? kNotice : kTrouble;
}

std::string far_sweeps(const wire::SolveFigures& solve) {
  if (solve.far_sweeps == 0) return "rest";
  if (solve.far_interval > 1) return format("%u in %u ticks", solve.far_sweeps, solve.far_interval);
  return std::to_string(solve.far_sweeps);
}

void rate_rows(const HudModel& model) {
  const wire::FrameFigures& figures = model.figures;
  const wire::RateFigures& rate = figures.pace.rate;
  const RateText text = describe(figures);
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::TextDisabled("detail");
  ImGui::TableNextColumn();
  if (rate.level == wire::RateLevel::Fixed)
    ImGui::TextUnformatted(text.level.c_str());
  else
    ImGui::TextColored(colour_of(text.tone), "%s", text.level.c_str());
  if (!text.sweeps.empty()) row("sweeps", text.sweeps + "; others " + far_sweeps(figures.solve));
  if (figures.near.node_limit > 0)
    row("queue limit", with_thousands(figures.near.node_limit) + " nodes");
  if (!text.load.empty()) row("next tick", text.load + " allowed");
  if (!text.changes.empty()) row("changes", text.changes);
  row("time", format("%.0f %% of real time", 100 * static_cast<double>(rate.time_rate)));
}

void help_row(const char* key, const char* what) {
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::PushFont(bold());
  ImGui::TextUnformatted(key);
  ImGui::PopFont();
  ImGui::TableNextColumn();
  ImGui::TextUnformatted(what);
}

}  // namespace

std::string clock_text(double seconds) {
  const int whole = static_cast<int>(seconds);
  return format("%d:%04.1f", whole / 60, seconds - whole / 60 * 60);
}

std::string byte_rate(double bytes_per_second) {
  if (bytes_per_second < 1e6) return format("%.1f kB/s", bytes_per_second / 1e3);
  return format("%.2f MB/s", bytes_per_second / 1e6);
}

namespace {

constexpr double kOldPictureMs = 250;

// These are for whoever studies the solver or the network.
void figure_rows(const HudModel& model) {
  const auto& f = model.figures;
  row("tick", format("%.0f us median, %.0f us p99", f.pace.tick_median_us, f.pace.tick_p99_us));
  row("slow ticks", with_thousands(f.pace.slow_ticks));
  row("active nodes", format("%s, queue %s", with_thousands(f.near.active_nodes).c_str(),
                             with_thousands(f.near.queue_nodes).c_str()));
  // The line of the controller says more, where it decides.
  if (f.solve.layer_sweeps[0] == 0)
    row("sweeps", format("%u, all other nodes %s", f.solve.sweeps, far_sweeps(f.solve).c_str()));
  rate_rows(model);
  row("residual", format("%.2g mN", static_cast<double>(f.solve.residual_n) * 1e3));
  row("regions", std::to_string(f.near.region_count));
  if (f.relaxation) {
    row("elastic energy", format("%.3g mJ", f.relaxation->energy_j * 1e3));
    row("volume", format("%+.3f %%", 100 * f.relaxation->volume_change));
    row("relaxed", format("%.0f %% of the stress", 100 * f.relaxation->relaxed_share));
  }
  if (!model.timeline) row("round trip", format("%.1f ms", model.round_trip_ms));
  row("stream", format("%.1f frames/s, %s", model.frames_per_second,
                       byte_rate(model.bytes_per_second).c_str()));
  row("display", format("%.0f pictures/s", model.pictures_per_second));
}

}  // namespace

Box draw_session_panel(const HudModel& model, float scale) {
  ImGui::SetNextWindowPos({kMargin * scale, kMargin * scale});
  ImGui::SetNextWindowSizeConstraints({300 * scale, 0}, {600 * scale, 2000 * scale});
  ImGui::Begin("session", nullptr, kGlass);
  heading(model.title.c_str());
  ImGui::TextDisabled("%s", model.own_role.c_str());
  ImGui::TextDisabled("%s", model.organ.c_str());
  ImGui::Separator();
  if (ImGui::BeginTable("figures", 2, ImGuiTableFlags_SizingFixedFit)) {
    row("session time", clock_text(model.session_seconds));
    if (model.is_recorded) row("recorded", *model.is_recorded ? "yes" : "no");
    if (model.shows_rate) figure_rows(model);
    if (!model.is_paused && model.surface_age_ms &&
        (model.shows_rate || *model.surface_age_ms > kOldPictureMs))
      row("age of picture", format("%.0f ms", *model.surface_age_ms));
    if (model.shows_rate || !model.is_in_step) {
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      ImGui::TextDisabled("surface");
      ImGui::TableNextColumn();
      ImGui::TextColored(model.is_in_step ? kGood : kTrouble, "%s", model.sync_text.c_str());
    }
    ImGui::EndTable();
  }
  const Box box = box_of_window();
  ImGui::End();
  return box;
}

Box draw_banners(const HudModel& model, const Box& session, const Box& people, float scale,
                 float top) {
  const std::vector<Banner> banners = banners_of(model);
  if (banners.empty() && model.messages.empty()) return {};
  constexpr float kLeastWidth = 300;
  const float right = people.right > 0 ? people.left : ImGui::GetIO().DisplaySize.x;
  const float width = std::max(right - session.right - 2 * kMargin * scale, kLeastWidth * scale);
  const ImVec2 pad = ImGui::GetStyle().WindowPadding;
  ImGui::SetNextWindowPos({(session.right + right) / 2, top + kMargin * scale}, 0, {0.5f, 0});
  ImGui::Begin("banners", nullptr, kGlass);
  ImGui::PushTextWrapPos(width - pad.x);
  bool is_first = true;
  for (const Banner& banner : banners) {
    if (!std::exchange(is_first, false)) ImGui::Separator();
    ImGui::PushFont(bold());
    ImGui::TextColored(colour_of(banner.tone), "%s", banner.text.c_str());
    ImGui::PopFont();
    if (!banner.advice.empty()) ImGui::TextUnformatted(banner.advice.c_str());
  }
  for (const HudMessage& message : model.messages) {
    const float alpha = std::clamp(5.0f - message.age_seconds, 0.0f, 1.0f);
    if (alpha <= 0) continue;
    if (!std::exchange(is_first, false)) ImGui::Separator();
    ImVec4 colour = message.is_trouble ? kTrouble : kGood;
    colour.w = alpha;
    ImGui::TextColored(colour, "%s", message.text.c_str());
  }
  ImGui::PopTextWrapPos();
  const Box box = box_of_window();
  ImGui::End();
  return box;
}

Box draw_help(const HudModel& model, const Box& timeline, const Sides& sides, const Box& before,
              float scale) {
  const ImVec2 screen = ImGui::GetIO().DisplaySize;
  const float bottom = (timeline.top > 0 ? timeline.top : screen.y) - kMargin * scale;
  // Under the panel of people: the bar of one's own force is at the left.
  const bool covers = bottom - (before.bottom - before.top) < sides.right.bottom;
  if (model.timeline && covers && sides.left.bottom < sides.right.bottom)
    ImGui::SetNextWindowPos({kMargin * scale, bottom}, 0, {0, 1});
  else
    ImGui::SetNextWindowPos({screen.x - kMargin * scale, bottom}, 0, {1, 1});
  ImGui::SetNextWindowBgAlpha(model.shows_help ? 0.86f : 0.45f);
  ImGui::Begin("help", nullptr, kGlass);
  if (!model.shows_help) {
    ImGui::TextDisabled(
        model.has_own_tool ? "1-9 instrument   left button use it   wheel depth   Q E turn   H help"
                           : "right drag turn   Ctrl+wheel zoom   H help");
    const Box box = box_of_window();
    ImGui::End();
    return box;
  }
  heading("Mouse and keyboard");
  ImGui::Separator();
  if (ImGui::BeginTable("keys", 2, ImGuiTableFlags_SizingFixedFit)) {
    if (model.has_own_tool) {
      help_row("move", "the tip follows the pointer, just above the tissue");
      help_row("1 to 9, 0", "take another instrument");
      help_row("left button", "use it: a grasper holds, an edge cuts, others push");
      help_row("F, Space, X", "push, grasp, cut, where the instrument can");
      help_row("Q, E", "turn it about its shaft");
      if (model.tray.hands > 1) help_row("Tab", "the other hand; this one goes on holding");
      help_row("wheel, W / S", "depth along the view; Shift: finer");
    }
    if (model.can_mark) {
      help_row("M", "mark the organ as it is");
      help_row("Backspace", "return it to the mark, for everybody");
      help_row("P", "pause the session for everybody, or let it go on");
    }
    if (model.can_lend_view)
      help_row("T",
               model.timeline ? "see with the next tool" : "see through an endoscope, or the next");
    if (!model.view_text.empty()) help_row("V", "follow the view that was given, or do not");
    if (model.timeline) {
      help_row("Space", "play or pause");
      help_row("left, right", "two seconds back or on");
      help_row(", .", "one picture back or on");
      help_row("Page Up, Page Down", "to the event before or after");
    }
    if (model.pair) {
      help_row("U", model.pair->has_own_views ? "one view for both" : "a view for each");
      if (model.pair->has_stages.value_or(false))
        help_row("B", model.pair->is_by_stage ? "both from their start" : "stage by stage");
    }
    help_row("D", "measure: click two points; D or Esc ends that");
    help_row("right drag", "turn the view");
    help_row("middle drag", "move the view");
    help_row("Ctrl+wheel, + -", "zoom");
    help_row("C", "view as at the start");
    help_row("O", model.shows_regions ? "hide active regions" : "show active regions");
    help_row("L", model.shows_holds ? "hide who holds what" : "show who holds what");
    help_row("A", model.shows_arrows ? "hide force arrows" : "show force arrows");
    help_row("R",
             model.shows_rate ? "hide the figures for research" : "show the figures for research");
    help_row("F12", "screenshot into the current folder");
    help_row("H, F1", "hide this");
    ImGui::EndTable();
  }
  ImGui::TextDisabled("Arrows: force of the tissue on a tool, 20 mm per N.");
  ImGui::TextDisabled("A line from a tool to a small ball: where the hand is, when");
  ImGui::TextDisabled("tissue keeps the tool from it.");
  const Box box = box_of_window();
  ImGui::End();
  return box;
}

void draw_away_veil() {
  ImGui::GetBackgroundDrawList()->AddRectFilled({0, 0}, ImGui::GetIO().DisplaySize,
                                                IM_COL32(104, 108, 112, 170));
}

}  // namespace trocar::ui
