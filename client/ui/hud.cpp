#include "client/ui/hud.h"

#include <algorithm>
#include <utility>

#include "client/render/gl.h"
#include "client/ui/hud_panels.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include "client/ui/panel_style.h"
#include "common/base/log.h"

namespace trocar::ui {
namespace {

constexpr float kFontPixels = 14.0f;
// The panels need this much room at scale 1, in pixels: then none covers another, nor the middle.
constexpr float kLayoutWidth = 1160, kLayoutHeight = 620;

// Keys that went down since the last picture. Dear ImGui samples keys once per picture and would
// miss a short press at a low rate. GLFW callbacks carry no context of ours, and there is one Hud.
std::vector<KeyPress>& pressed_keys() {
  static std::vector<KeyPress> keys;
  return keys;
}
void remember_key(GLFWwindow*, int key, int, int action, int modifiers) {
  if (action == GLFW_PRESS)
    pressed_keys().push_back(
        {key, (modifiers & GLFW_MOD_SHIFT) != 0, (modifiers & GLFW_MOD_CONTROL) != 0});
}

// It is what is asked for, or what the monitor says, as far as the panels fit into the window.
float scale_of(render::GlContext& context, double asked) {
  const render::Size size = context.size();
  auto scale = static_cast<float>(asked);
  if (asked <= 0) {
    float x = 1, y = 1;
    if (GLFWwindow* window = context.window()) glfwGetWindowContentScale(window, &x, &y);
    scale = std::max(x, 1.0f);
    if (size.height > 1300) scale = std::max(scale, static_cast<float>(size.height) / 1080.0f);
  }
  const float room = std::min(static_cast<float>(size.width) / kLayoutWidth,
                              static_cast<float>(size.height) / kLayoutHeight);
  const float fitting = std::clamp(scale, kLeastScale, std::clamp(room, kLeastScale, kMostScale));
  if (asked > 0 && fitting < scale)
    log::warn("--scale {} is too large for a window of {}x{}: it is {:.2f}", asked, size.width,
              size.height, fitting);
  return fitting;
}

void set_style(float scale) {
  ImGui::StyleColorsDark();
  ImGuiStyle& style = ImGui::GetStyle();
  style.WindowRounding = 9;
  style.FrameRounding = 5;
  style.GrabRounding = 5;
  style.WindowBorderSize = 1;
  style.WindowPadding = {13, 11};
  style.ItemSpacing = {8, 5};
  style.CellPadding = {5, 2};
  ImVec4* colours = style.Colors;
  colours[ImGuiCol_WindowBg] = to_imgui(kPanelGround, 0.80f);
  colours[ImGuiCol_PopupBg] = to_imgui(kPanelGround, 1);
  colours[ImGuiCol_Border] = {0.55f, 0.70f, 0.80f, 0.16f};
  colours[ImGuiCol_Text] = {0.87f, 0.91f, 0.94f, 1};
  colours[ImGuiCol_TextDisabled] = {0.52f, 0.60f, 0.66f, 1};
  colours[ImGuiCol_FrameBg] = {0.16f, 0.21f, 0.26f, 0.75f};
  colours[ImGuiCol_FrameBgHovered] = {0.20f, 0.28f, 0.35f, 0.85f};
  colours[ImGuiCol_FrameBgActive] = {0.22f, 0.33f, 0.42f, 0.95f};
  colours[ImGuiCol_SliderGrab] = {0.30f, 0.72f, 0.92f, 1};
  colours[ImGuiCol_SliderGrabActive] = {0.45f, 0.82f, 1.0f, 1};
  colours[ImGuiCol_Button] = {0.16f, 0.23f, 0.29f, 0.9f};
  colours[ImGuiCol_ButtonHovered] = {0.22f, 0.36f, 0.46f, 1};
  colours[ImGuiCol_ButtonActive] = {0.26f, 0.46f, 0.60f, 1};
  colours[ImGuiCol_Separator] = {0.55f, 0.70f, 0.80f, 0.16f};
  style.ScaleAllSizes(scale);
}

}  // namespace

Hud::Hud(render::GlContext& context, double scale)
    : context_(context), help_(std::make_unique<Box>()) {
  IMGUI_CHECKVERSION();
  ImGui::CreateContext();
  ImGuiIO& io = ImGui::GetIO();
  io.IniFilename = nullptr;
  if (GLFWwindow* window = context.window()) {
    glfwSetKeyCallback(window, remember_key);  // Dear ImGui's calls it in turn
    ImGui_ImplGlfw_InitForOpenGL(window, true);
  }
  scale_ = scale_of(context, scale);
  ImGui_ImplOpenGL3_Init("#version 330 core");
  fonts_.emplace(kFontPixels * scale_);
  set_style(scale_);
}

Hud::~Hud() {
  ImGui_ImplOpenGL3_Shutdown();
  if (context_.window() != nullptr) ImGui_ImplGlfw_Shutdown();
  ImGui::DestroyContext();
}

void Hud::need_letters(const HudModel& model) {
  for (const std::string* text :
       {&model.title, &model.organ, &model.own_role, &model.status, &model.recording_text,
        &model.frozen_text, &model.view_text, &model.lent_text, &model.pace_text})
    fonts_->need(*text);
  for (const HudParticipant& participant : model.participants) fonts_->need(participant.name);
  for (const HudMessage& message : model.messages) fonts_->need(message.text);
  if (model.conduct)
    for (const auto& mark : model.conduct->marks) fonts_->need(mark);
  if (model.lesson) {
    for (const auto* text : {&model.lesson->title, &model.lesson->stage, &model.lesson->text,
                             &model.lesson->hint, &model.lesson->verdict})
      fonts_->need(*text);
    for (const auto& [head, lines] : model.lesson->results) {
      fonts_->need(head);
      for (const auto& line : lines) fonts_->need(line);
    }
  }
  if (model.pair)
    for (const HudHalf& half : model.pair->halves) {
      for (const auto* text : {&half.name, &half.organ, &half.stage, &half.stopped})
        fonts_->need(*text);
      for (const HudParticipant& participant : half.participants) fonts_->need(participant.name);
    }
  const auto* story = model.timeline ? model.timeline->story.get() : nullptr;
  if (story != nullptr && story != read_story_)
    for (const auto& event : story->events) fonts_->need(event.text);
  read_story_ = story;
}

void Hud::begin_frame(float seconds) {
  if (fonts_->update()) {
    ImGui_ImplOpenGL3_DestroyFontsTexture();
    ImGui_ImplOpenGL3_CreateFontsTexture();
  }
  ImGui_ImplOpenGL3_NewFrame();
  if (context_.window() != nullptr) {
    ImGui_ImplGlfw_NewFrame();
  } else {
    const render::Size size = context_.size();
    ImGui::GetIO().DisplaySize = {static_cast<float>(size.width), static_cast<float>(size.height)};
    ImGui::GetIO().DeltaTime = std::max(seconds, 1e-4f);
  }
  ImGui::NewFrame();
}

device::PointerInput Hud::input() const {
  device::PointerInput input;
  input.is_over_scene = false;
  if (context_.window() == nullptr) return input;
  const ImGuiIO& io = ImGui::GetIO();
  const auto key = [](int code) { return ImGui::IsKeyDown(code); };
  // Dear ImGui counts in screen coordinates, the camera in pixels of the framebuffer.
  input.x = io.MousePos.x * io.DisplayFramebufferScale.x;
  input.y = io.MousePos.y * io.DisplayFramebufferScale.y;
  input.dx = io.MouseDelta.x * io.DisplayFramebufferScale.x;
  input.dy = io.MouseDelta.y * io.DisplayFramebufferScale.y;
  const bool is_inside = io.MousePos.x >= 0 && io.MousePos.y >= 0 &&
                         io.MousePos.x < io.DisplaySize.x && io.MousePos.y < io.DisplaySize.y;
  input.is_over_scene = is_inside && !io.WantCaptureMouse;
  if (!io.WantCaptureMouse) {
    input.wheel = io.MouseWheel;
    input.left = io.MouseDown[0];
    input.right = io.MouseDown[1];
    input.middle = io.MouseDown[2];
  }
  input.control = io.KeyCtrl;
  input.shift = io.KeyShift;
  if (io.WantTextInput) return input;
  input.push = key(GLFW_KEY_F);
  input.grasp = key(GLFW_KEY_SPACE);
  input.cut = key(GLFW_KEY_X);
  input.deeper = key(GLFW_KEY_W);
  input.nearer = key(GLFW_KEY_S);
  input.roll_left = key(GLFW_KEY_Q);
  input.roll_right = key(GLFW_KEY_E);
  input.zoom_in = key(GLFW_KEY_EQUAL) || key(GLFW_KEY_KP_ADD);
  input.zoom_out = key(GLFW_KEY_MINUS) || key(GLFW_KEY_KP_SUBTRACT);
  return input;
}

Sides Hud::draw_session(const HudModel& model, HudActions& actions) {
  if (model.is_away) draw_away_veil();
  const Box session = draw_session_panel(model, scale_);
  const Box people = draw_participants_panel(model, scale_);
  const Box banners = draw_banners(model, session, people, scale_);
  draw_labels(model.labels, banners, scale_);
  for (const HudRuler& ruler : model.rulers) draw_ruler(ruler, scale_);
  Box right = model.lesson ? draw_lesson(*model.lesson, people, scale_, actions) : people;
  if (model.figures.blood && model.figures.blood->shed_nl > 0)
    right = draw_blood(*model.figures.blood, right, scale_);
  draw_felt_hands(model, right.bottom, scale_);
  draw_own_forces(model, scale_);
  const Box left = model.conduct ? draw_conduct(*model.conduct, session, scale_, actions) : session;
  if (model.tray.hands > 0) draw_tray(model, left, scale_, actions);
  return {left, right};
}

HudActions Hud::draw(const HudModel& model) {
  HudActions actions;
  need_letters(model);  // for the next picture
  Sides sides;
  if (model.pair)
    draw_pair(model, scale_);
  else
    sides = draw_session(model, actions);
  Box timeline;
  if (model.timeline) timeline = draw_timeline(model, scale_, actions);
  *help_ = draw_help(model, timeline, sides, *help_, scale_);
  ImGui::Render();
  const auto keys = std::exchange(pressed_keys(), {});
  if (ImGui::GetIO().WantTextInput) return actions;
  const auto pressed = [&](int code) {
    return std::ranges::find(keys, code, &KeyPress::code) != keys.end();
  };
  actions.toggle_help = pressed(GLFW_KEY_H) || pressed(GLFW_KEY_F1);
  actions.toggle_regions = pressed(GLFW_KEY_O);
  actions.toggle_holds = pressed(GLFW_KEY_L);
  actions.toggle_arrows = pressed(GLFW_KEY_A);
  actions.toggle_rate = pressed(GLFW_KEY_R);
  actions.reset_camera = pressed(GLFW_KEY_C);
  actions.screenshot = pressed(GLFW_KEY_F12);
  if (pressed(GLFW_KEY_D)) actions.toggle_measure = true;
  if (model.pair) {
    if (pressed(GLFW_KEY_U)) actions.toggle_own_views = true;
    if (pressed(GLFW_KEY_B)) actions.toggle_alignment = true;
  }
  actions.leave = pressed(GLFW_KEY_ESCAPE);
  if (model.lesson) {
    actions.answer =
        model.lesson->can_answer && (pressed(GLFW_KEY_ENTER) || pressed(GLFW_KEY_KP_ENTER));
    actions.next_stage = model.lesson->can_lead && pressed(GLFW_KEY_N);
    actions.restart_lesson = model.lesson->can_lead && pressed(GLFW_KEY_K);
    // Only when it is over, so that no slip of a finger ends an attempt.
    if (model.lesson->can_go_on && model.lesson->is_over) {
      if (pressed(GLFW_KEY_N)) actions.after_lesson = AfterLesson::Next;
      if (pressed(GLFW_KEY_K)) actions.after_lesson = AfterLesson::Repeat;
      if (pressed(GLFW_KEY_BACKSPACE)) actions.after_lesson = AfterLesson::Leave;
    }
  }
  if (model.conduct && pressed(GLFW_KEY_P))
    actions.lead = replica::LeadWish{
        .action = model.conduct->is_paused ? replica::LeadAction::GoOn : replica::LeadAction::Pause,
        .name = {}};
  actions.switch_hand = model.tray.hands > 1 && pressed(GLFW_KEY_TAB);
  for (const auto& key : keys) {
    if (model.tray.hands == 0 || key.code < GLFW_KEY_0 || key.code > GLFW_KEY_9) continue;
    const int digit = key.code == GLFW_KEY_0 ? 9 : key.code - GLFW_KEY_1;
    const auto number = static_cast<std::size_t>(digit + (key.has_shift ? 10 : 0));
    if (number < model.tray.names.size()) actions.take_instrument = number;
  }
  actions.next_lent_view = model.can_lend_view && pressed(GLFW_KEY_T);
  actions.toggle_follow = !model.view_text.empty() && pressed(GLFW_KEY_V);
  actions.set_mark = model.can_mark && pressed(GLFW_KEY_M);
  actions.return_to_mark = model.can_mark && pressed(GLFW_KEY_BACKSPACE);
  if (model.timeline && pressed(GLFW_KEY_SPACE)) actions.toggle_play = true;
  if (model.timeline && (pressed(GLFW_KEY_LEFT) || pressed(GLFW_KEY_RIGHT)))
    actions.seek_seconds = model.timeline->position_seconds + (pressed(GLFW_KEY_LEFT) ? -2.0 : 2.0);
  if (model.timeline && (pressed(GLFW_KEY_COMMA) || pressed(GLFW_KEY_PERIOD))) {
    constexpr double kPictureSeconds = static_cast<double>(kTicksPerFrame) / kTicksPerSecond;
    actions.pause = true;
    actions.seek_seconds = model.timeline->position_seconds +
                           (pressed(GLFW_KEY_COMMA) ? -kPictureSeconds : kPictureSeconds);
  }
  if (model.timeline && (pressed(GLFW_KEY_PAGE_UP) || pressed(GLFW_KEY_PAGE_DOWN)))
    if (const auto at = event_beside(*model.timeline, pressed(GLFW_KEY_PAGE_DOWN)))
      actions.seek_seconds = at;
  return actions;
}

std::vector<KeyPress> Hud::take_keys() {
  return std::exchange(pressed_keys(), {});
}

bool Hud::take_enter() {
  return std::ranges::any_of(take_keys(), [](const KeyPress& key) {
    return key.code == GLFW_KEY_ENTER || key.code == GLFW_KEY_KP_ENTER;
  });
}

void Hud::render() {
  glBindFramebuffer(GL_FRAMEBUFFER, context_.framebuffer());
  const render::Size size = context_.size();
  glViewport(0, 0, size.width, size.height);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
}

}  // namespace trocar::ui
