#include "client/editor/editor_window.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <numbers>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <imgui.h>

#include "common/base/log.h"
#include "server/organs/edit/save.h"

namespace trocar::editor {
namespace {

constexpr int kRingPoints = 48;
constexpr float kDabPixels = 6;  // between two dabs of a stroke
constexpr int kMostDabs = 40;    // in a picture
constexpr double kPoissonRatio = 0.45;

// Whether the key writes this letter, wherever it lies on this keyboard.
bool writes(int key, char letter) {
  const char* name = glfwGetKeyName(key, 0);
  return name != nullptr && name[0] == letter && name[1] == 0;
}

template <std::size_t Size>
void set_text(std::array<char, Size>& to, const std::string& text) {
  std::snprintf(to.data(), Size, "%s", text.c_str());
}

}  // namespace

Result<std::unique_ptr<EditorWindow>> EditorWindow::open(edit::Editor& editor,
                                                         const WindowSettings& settings) {
  auto context =
      render::make_window_context(settings.size, editor.organ().name + " - Trocar organ editor");
  if (!context) return context.error();
  return std::unique_ptr<EditorWindow>(new EditorWindow(editor, settings, std::move(*context)));
}

EditorWindow::EditorWindow(edit::Editor& editor, const WindowSettings& settings,
                           std::unique_ptr<render::GlContext> context)
    : editor_(editor),
      materials_(settings.materials),
      context_(std::move(context)),
      renderer_(*context_),
      hud_(*context_, settings.scale),
      view_(editor.organ()),
      brush_(editor.organ().mesh) {
  set_text(state_.file, settings.file);
  const auto& positions = editor.organ().mesh.rest_positions;
  for (const Vec3d& p : positions) {
    const std::array<double, 3> at{p.x, p.y, p.z};
    for (std::size_t i = 0; i < 3; ++i) {
      const auto mm = static_cast<float>(at[i] * 1e3);
      state_.low_mm[i] = std::min(state_.low_mm[i], std::floor(mm));
      state_.high_mm[i] = std::max(state_.high_mm[i], std::ceil(mm));
    }
  }
  camera_.frame({}, view_.radius_m());
}

void EditorWindow::follow_organ() {
  const auto& regions = editor_.organ().regions;
  if (state_.region && *state_.region >= regions.size()) state_.region.reset();
  if (state_.part && *state_.part >= regions.size()) state_.part.reset();
  if (seen_version_ == editor_.version()) return;
  seen_version_ = editor_.version();
  view_.colour(editor_.organ());
  figures_ = figures_of(editor_);
  hud_.need(figures_.name);
  hud_.need(figures_.source);
  for (const auto& region : regions) hud_.need(region.name);
}

void EditorWindow::draw(float seconds) {
  context_->poll_events();
  if (context_->should_close()) ask_for_end();
  follow_organ();
  hud_.need(state_.new_name.data());
  hud_.need(state_.file.data());
  hud_.begin_frame(seconds);
  const float width = kPanelLetters * ImGui::GetFontSize();
  const float pixels = ImGui::GetIO().DisplayFramebufferScale.x;
  const render::Size whole = context_->size();
  const int left = std::min(static_cast<int>(width * pixels), whole.width / 2);
  region_ = {left, 0, {whole.width - left, whole.height}};
  auto input = hud_.input();
  input.x -= static_cast<float>(left);
  camera_.update(input, region_.size, seconds);
  const auto actions = draw_panel(editor_, figures_, press_.figures(), materials_,
                                  static_cast<float>(left) / pixels, state_);
  paint(input);
  press(input, seconds);
  draw_brush(input);
  take_keys();
  act(actions);
  follow_organ();
  auto scene = view_.scene(state_.shows_held, state_.shows_regions, state_.shows_fine());
  scene.seconds = seconds;
  press_.add_to(scene);
  ImGui::Render();
  renderer_.draw(scene, camera_, region_);
  hud_.render();
  if (wants_picture_) take_picture();
  context_->present();
}

void EditorWindow::take_keys() {
  const auto keys = ui::Hud::take_keys();
  constexpr auto kAnyPopup = ImGuiPopupFlags_AnyPopupId | ImGuiPopupFlags_AnyPopupLevel;
  if (ImGui::GetIO().WantTextInput) return;
  const bool is_asked = ImGui::IsPopupOpen("", kAnyPopup);  // and has to answer first
  for (const auto& key : keys) {
    if (key.code == GLFW_KEY_F12) wants_picture_ = true;
    if (is_asked) continue;
    if (key.has_control) {
      if (writes(key.code, 'z')) key.has_shift ? editor_.redo() : editor_.undo();
      if (writes(key.code, 'y')) editor_.redo();
      if (writes(key.code, 's')) save(false);
      continue;
    }
    if (key.code == GLFW_KEY_1) state_.mode = Mode::Look;
    if (key.code == GLFW_KEY_2) state_.mode = Mode::Hold;
    if (key.code == GLFW_KEY_3) state_.mode = Mode::Region;
    if (key.code == GLFW_KEY_4) state_.mode = Mode::Press;
    if (key.code == GLFW_KEY_F) state_.wants_fine = !state_.wants_fine;
    if (key.code == GLFW_KEY_C) camera_.frame({}, view_.radius_m());
  }
}

void EditorWindow::act(const PanelActions& actions) {
  if (actions.undo) editor_.undo();
  if (actions.redo) editor_.redo();
  if (actions.hold_box || actions.paint_box) use_box(false);
  if (actions.release_box || actions.unpaint_box) use_box(true);
  if (actions.hold_none) editor_.release(editor_.organ().fixed_nodes);
  if (actions.remove_region && state_.region) editor_.remove_region(*state_.region);
  if (actions.raise_region && state_.region && editor_.raise_region(*state_.region))
    state_.region = state_.part = editor_.organ().regions.size() - 1;
  if (actions.rename_region && state_.region) {
    const auto renamed = editor_.rename_region(*state_.region, state_.new_name.data());
    if (renamed)
      state_.new_name = {};
    else
      state_.say(renamed.error().message, true);
  }
  if (actions.use_material) use_material();
  if (actions.save) save(false);
  if (actions.replace) save(true);
  if (actions.close) is_over_ = true;
}

void EditorWindow::paint(const device::PointerInput& input) {
  const bool paints = state_.mode == Mode::Hold || state_.mode == Mode::Region;
  const bool is_left = input.left && paints && (is_stroke_ || input.is_over_scene);
  if (!is_left) {
    if (is_stroke_) end_stroke();
    was_left_ = input.left;
    return;
  }
  if (!is_stroke_) {
    if (was_left_) return;  // it went down elsewhere
    is_stroke_ = true;
    editor_.begin_stroke();
    stroke_nodes_.clear();
    last_x_ = input.x;
    last_y_ = input.y;
  }
  was_left_ = true;
  // A hand is faster than the pictures: the brush touches the way between them, too.
  const float way = std::hypot(input.x - last_x_, input.y - last_y_);
  const int dabs = std::clamp(static_cast<int>(std::ceil(way / kDabPixels)), 1, kMostDabs);
  const auto rays = camera_.rays(region_.size);
  for (int i = 1; i <= dabs; ++i) {
    const float share = static_cast<float>(i) / static_cast<float>(dabs);
    const auto place = view_.place_at(rays, last_x_ + (input.x - last_x_) * share,
                                      last_y_ + (input.y - last_y_) * share);
    if (place) dab(*place, input.shift);
  }
  last_x_ = input.x;
  last_y_ = input.y;
}

void EditorWindow::press(const device::PointerInput& input, float seconds) {
  if (state_.mode == Mode::Press && !input.control && input.wheel != 0)
    state_.press_mm = std::clamp(state_.press_mm + input.wheel, kLeastPress_mm, kMostPress_mm);
  const bool is_left = input.left && state_.mode == Mode::Press;
  if (!press_.is_pressed() && is_left && input.is_over_scene && !was_pressing_) {
    if (const auto place = view_.place_at(camera_.rays(region_.size), input.x, input.y))
      press_.begin(editor_.organ(), editor_.version(), static_cast<double>(state_.tip_mm) * 1e-3,
                   to_float(place->position_m), to_float(view_.normal_at(*place)));
  }
  was_pressing_ = is_left;
  if (!press_.is_pressed()) return;
  if (is_left)
    press_.go_on(static_cast<double>(state_.press_mm) * 1e-3, seconds);
  else
    press_.end();
  view_.move(press_.displacements());
}

void EditorWindow::dab(const edit::SurfacePlace& place, bool takes_away) {
  if (state_.mode == Mode::Region) return dab_region(place, takes_away);
  const auto nodes = brush_.nodes_at(place, static_cast<double>(state_.brush_mm) * 1e-3);
  takes_away ? editor_.release(nodes) : editor_.hold(nodes);
}

void EditorWindow::dab_region(const edit::SurfacePlace& place, bool takes_away) {
  const auto nodes = brush_.nodes_below(place, static_cast<double>(state_.brush_mm) * 1e-3,
                                        static_cast<double>(state_.paint_depth_mm) * 1e-3);
  if (takes_away) {
    if (state_.region) editor_.take_from_region(*state_.region, nodes);
  } else if (state_.region) {
    editor_.add_to_region(*state_.region, nodes);
  } else {
    stroke_nodes_.insert(stroke_nodes_.end(), nodes.begin(), nodes.end());
    begin_region(stroke_nodes_, false);
  }
  const auto count = editor_.organ().regions.size();
  if (state_.region && *state_.region >= count) state_.region.reset();
}

bool EditorWindow::begin_region(std::span<const NodeIndex> nodes, bool says_why) {
  std::string name = state_.new_name.data();
  if (name.empty()) name = "region " + std::to_string(editor_.organ().regions.size() + 1);
  const auto added = editor_.add_region(name, nodes);
  if (!added) {
    if (says_why) state_.say(added.error().message, true);
    return false;
  }
  state_.region = state_.part = *added;
  state_.new_name = {};
  stroke_nodes_.clear();
  return true;
}

void EditorWindow::end_stroke() {
  if (!stroke_nodes_.empty()) begin_region(stroke_nodes_, true);
  stroke_nodes_.clear();
  editor_.end_stroke();
  is_stroke_ = false;
}

void EditorWindow::use_box(bool takes_away) {
  const auto nodes = edit::nodes_in(state_.box(), editor_.organ().mesh);
  if (nodes.empty()) return state_.say("The box has no nodes.", true);
  state_.say(std::to_string(nodes.size()) + " nodes are in the box.");
  if (state_.mode != Mode::Region) {
    takes_away ? editor_.release(nodes) : editor_.hold(nodes);
  } else if (!state_.region) {
    if (!takes_away) begin_region(nodes, true);
  } else {
    takes_away ? editor_.take_from_region(*state_.region, nodes)
               : editor_.add_to_region(*state_.region, nodes);
  }
}

void EditorWindow::use_material() {
  const auto used =
      state_.choice < materials_.size()
          ? editor_.use_measured(state_.part, materials_[state_.choice])
          : editor_.use_neo_hookean(
                state_.part, static_cast<double>(state_.young_modulus_kpa) * 1e3, kPoissonRatio);
  used ? state_.say("The material is changed.") : state_.say(used.error().message, true);
}

void EditorWindow::save(bool may_replace) {
  const std::string file = state_.file.data();
  const bool is_own = file == saved_file_;
  const auto saved = edit::save(
      editor_.organ(), file, may_replace || is_own ? edit::Replace::Allow : edit::Replace::Refuse);
  if (saved) {
    editor_.set_saved();
    saved_file_ = file;
    state_.say("Saved: " + file);
    log::info("saved: {}", file);
    is_over_ = state_.closes_when_saved;
    return;
  }
  if (saved.error().code == ErrorCode::Refused) {
    state_.asks_to_replace = true;
    return;
  }
  state_.closes_when_saved = false;
  state_.say(saved.error().message, true);
}

void EditorWindow::ask_for_end() {
  if (!editor_.has_unsaved_changes()) {
    is_over_ = true;
    return;
  }
  glfwSetWindowShouldClose(context_->window(), GLFW_FALSE);
  state_.closes_when_saved = false;
  state_.asks_to_close = true;
}

void EditorWindow::draw_brush(const device::PointerInput& input) {
  const bool has_ring = state_.mode == Mode::Hold || state_.mode == Mode::Region;
  if (!has_ring || !input.is_over_scene) return;
  const auto place = view_.place_at(camera_.rays(region_.size), input.x, input.y);
  if (!place) return;
  const Vec3f normal = to_float(view_.normal_at(*place)), centre = to_float(place->position_m);
  const Quatf turn = rotation_from_z(normal);
  const float radius = state_.brush_mm * 1e-3f;
  std::vector<std::array<float, 2>> pixels;
  for (int i = 0; i < kRingPoints; ++i) {
    const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / kRingPoints;
    const Vec3f at =
        centre + rotate(turn, {radius * std::cos(angle), radius * std::sin(angle), 0.001f});
    const auto seen = camera_.project(at, region_.size);
    if (!seen) return;
    pixels.push_back({seen->x + static_cast<float>(region_.left), seen->y});
  }
  draw_ring(pixels, input.shift);
}

void EditorWindow::take_picture() {
  wants_picture_ = false;
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(
                      std::chrono::system_clock::now().time_since_epoch())
                      .count();
  const std::string file = "trocar-" + std::to_string(ms) + ".png";
  auto scene = view_.scene(state_.shows_held, state_.shows_regions, state_.shows_fine());
  press_.add_to(scene);
  renderer_.draw(scene, camera_, region_, render::Quality::Best);
  hud_.render();
  const auto written = render::write_png(context_->read_image(), file);
  written ? state_.say("Picture: " + file) : state_.say(written.error().message, true);
  if (written) log::info("screenshot: {}", file);
}

}  // namespace trocar::editor
