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

// The organ in the middle leaves so much at the right of a window of 1280 x 720.
constexpr float kHelpWidth = 270;

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
  ImGui::TextWrapped("%s", what);
}

// They stand in the order in which one needs them.
void help_rows(const HudModel& model) {
  if (model.has_own_tool) {
    help_row("move", "moves the tip");
    help_row("1 to 9, 0", "another instrument");
    help_row("left button", "use it: hold, cut or push");
    help_row("wheel, W S", "depth; with Shift finer");
    help_row("Q, E", "turn it about its shaft");
    if (model.tray.hands > 1) help_row("Tab", "right hand, left hand");
    help_row("F Space X", "push, grasp, cut");
  }
  if (model.lesson && model.lesson->can_answer) help_row("Enter", "answer: it is here");
  help_row("right drag", "turn the view");
  help_row("middle drag", "move the view");
  help_row("Ctrl+wheel", "zoom; also + and -");
  help_row("C", "the view as at the start");
  if (model.can_lend_view)
    help_row("T", model.timeline ? "see with the next tool" : "see through an endoscope");
  if (!model.view_text.empty()) help_row("V", "follow the view, or do not");
  if (model.timeline) {
    help_row("Space", "play or pause");
    help_row("left, right", "2 s back or forward");
    help_row(", .", "a picture back or forward");
    help_row("Page Up Dn", "to the event before or after");
  }
  if (model.pair) {
    help_row("U", model.pair->has_own_views ? "one view for both" : "a view for each");
    if (model.pair->has_stages.value_or(false))
      help_row("B", model.pair->is_by_stage ? "both from their start" : "stage by stage");
  }
  if (model.can_mark) {
    help_row("M", "mark the organ");
    help_row("Backspace", "return it to the mark");
    help_row("P", "pause for all, go on");
  }
  if (model.lesson && model.lesson->can_lead) help_row("N, K", "next stage, from the start");
  help_row("D", "measure a length, or end it");
  help_row("A", model.shows_arrows ? "hide force arrows" : "force arrows, 20 mm per N");
  help_row("L", model.shows_holds ? "hide who holds what" : "who holds what");
  help_row("O", model.shows_regions ? "hide how far forces reach" : "how far forces reach");
  help_row("R", model.shows_rate ? "hide names and figures" : "names and figures");
  help_row("F12", "save a picture");
  help_row("Esc", "leave what you are in");
  help_row("H, F1", "hide this");
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
  if (model.vertices > 0) row("surface vertices", with_thousands(model.vertices));
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
  // One knows where a session runs, and who one is; a recording is known by its file.
  const bool is_named = model.shows_rate || model.timeline;
  if (is_named) {
    heading(model.title.c_str());
    ImGui::TextDisabled("%s", model.own_role.c_str());
  }
  if (!model.organ.empty())
    is_named ? ImGui::TextDisabled("%s", model.organ.c_str()) : heading(model.organ.c_str());
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

namespace {

float fading(const HudMessage& message) {
  return std::clamp(5.0f - message.age_seconds, 0.0f, 1.0f);
}

}  // namespace

Box draw_banners(const HudModel& model, const Box& session, const Box& people, float scale,
                 float top) {
  const std::vector<Banner> banners = banners_of(model);
  float strongest =
      banners.empty() ? 0 : 1;  // how much of the box is there: it fades with its words
  for (const HudMessage& message : model.messages) strongest = std::max(strongest, fading(message));
  if (strongest <= 0) return {};
  constexpr float kLeastWidth = 300;
  const float right = people.right > 0 ? people.left : ImGui::GetIO().DisplaySize.x;
  const float width = std::max(right - session.right - 2 * kMargin * scale, kLeastWidth * scale);
  const ImVec2 pad = ImGui::GetStyle().WindowPadding;
  ImGui::SetNextWindowPos({(session.right + right) / 2, top + kMargin * scale}, 0, {0.5f, 0});
  ImGui::SetNextWindowBgAlpha(0.8f * strongest);
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
    const float alpha = fading(message);
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

// The keys stand in the column at the right, beside the organ and below what is there. Where they
// do not fit, one scrolls them.
Box draw_help(const HudModel& model, const Box& timeline, const Sides& sides, const Box& before,
              float scale) {
  const ImVec2 screen = ImGui::GetIO().DisplaySize;
  const float bottom = (timeline.top > 0 ? timeline.top : screen.y) - kMargin * scale;
  const float room = bottom - sides.right.bottom - kMargin * scale;
  const bool scrolls = model.shows_help && before.bottom - before.top >= room;
  ImGui::SetNextWindowPos({screen.x - kMargin * scale, bottom}, 0, {1, 1});
  ImGui::SetNextWindowBgAlpha(model.shows_help ? 0.86f : 0.45f);
  if (model.shows_help)
    ImGui::SetNextWindowSizeConstraints({kHelpWidth * scale, 0},
                                        {kHelpWidth * scale, std::max(room, 80 * scale)});
  ImGui::Begin("help", nullptr, scrolls ? kPanel & ~ImGuiWindowFlags_NoScrollbar : kGlass);
  if (!model.shows_help) {
    ImGui::TextDisabled(
        model.has_own_tool ? "1-9 instrument   left button use it   wheel depth   Q E turn   H help"
                           : "right drag turn   Ctrl+wheel zoom   H help");
  } else {
    heading("Mouse and keys");
    ImGui::Separator();
    if (ImGui::BeginTable("keys", 2)) {
      ImGui::TableSetupColumn("", ImGuiTableColumnFlags_WidthFixed, 82 * scale);
      ImGui::TableSetupColumn("", ImGuiTableColumnFlags_WidthFixed, 145 * scale);
      help_rows(model);
      ImGui::EndTable();
    }
  }
  const Box box = box_of_window();
  ImGui::End();
  return box;
}

void draw_away_veil() {
  ImGui::GetBackgroundDrawList()->AddRectFilled({0, 0}, ImGui::GetIO().DisplaySize,
                                                IM_COL32(104, 108, 112, 170));
}

}  // namespace trocar::ui
