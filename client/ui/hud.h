#pragma once

// The head-up display stands in front of the scene: it shows figures of the session, participants,
// messages, names at tools, help, and the timeline of a replay. Dear ImGui, with a window's events
// or (headless) none.
//
// Per picture: begin_frame, then input(), then draw(model), then, after the scene was drawn into
// the context's framebuffer, render(). Thread: render thread. One Hud per process (Dear ImGui keeps
// one context).

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/device/view_rays.h"
#include "client/render/gl_context.h"
#include "client/replica/client_messages.h"
#include "client/replica/session_source.h"
#include "client/replica/session_view.h"
#include "client/shape/tool_mesh.h"
#include "client/ui/felt_text.h"
#include "client/ui/fonts.h"

namespace trocar::ui {

struct Box;  // a part of the screen
struct Sides;

// The scale of words and panels is in pixels per pixel of the design.
inline constexpr float kLeastScale = 0.75f, kMostScale = 3;

struct HudParticipant {
  std::string name;
  replica::Role role = replica::Role::Unknown;
  bool is_self = false;
  bool has_tool = false;  // the rest is valid
  shape::Colour colour;
  tool::Verb verb = tool::Verb::None;
  tool::Form form = tool::Form::Plain;  // of the tool with that verb
  bool has_claim = false, is_silent = false;
  bool is_away = false;    // the connection is lost, the place is kept
  bool is_frozen = false;  // an instructor keeps the tools where they are
  bool is_inside = false;  // it appeared inside tissue and touches nothing
  bool waits = false;      // its tool is held back, or was a moment ago
  float force_n = 0, torque_nm = 0;
  std::uint32_t contact_nodes = 0;
  std::vector<float> forces_n;  // over the last seconds, oldest first, evenly spaced
};

struct HudLabel {
  float x = 0, y = 0;  // pixels; the text stands to the right
  std::string text;
  shape::Colour colour;
};

// A length that is measured: a line between two ends, or one end.
struct HudRuler {
  struct End {
    float x = 0, y = 0;  // pixels
  };
  std::vector<End> ends;
  std::string text;  // "12.3 mm"
};

struct HudMessage {
  std::string text;
  float age_seconds = 0;  // fades between 4 and 5 s
  bool is_trouble = false;
};

struct HudTimeline {
  double first_seconds = 0, last_seconds = 0, position_seconds = 0;
  bool is_playing = false;
  float speed = 1;
  std::shared_ptr<const replica::PlaybackStory> story;  // null: still searched
  bool is_measuring = false;
};
// When the next event after where the recording is takes place, or the one before it; nothing if
// there is none. While it plays, an event just passed is not the one before.
std::optional<double> event_beside(const HudTimeline& timeline, bool is_next);

// The instruments that a hand may take; hands 0: there is nothing to choose.
struct HudTray {
  std::vector<std::string> names, texts;
  std::size_t chosen = 0;
  std::size_t hand = 0, hands = 0;  // that the pointer moves; of so many
};

// The stage of a lesson, or how it has ended.
struct HudLesson {
  std::string title, stage, text, hint;  // "2 of 3: Search"; hint: empty: not yet
  std::optional<float> progress;         // 0 to 1; nothing: the goal has none, or a recording
  double seconds = 0, limit_s = 0;
  float force_limit_n = 0;  // 0: there is none
  bool is_too_strong = false;
  bool can_answer = false, can_lead = false;  // with Enter; N and K
  bool is_over = false;
  float points = 0;
  std::vector<std::pair<std::string, std::vector<std::string>>> results;  // head and lines
  std::string verdict;  // on one's own last answer; empty: there is none in this stage
  bool is_right = false;
  std::string outcome;              // once it is over: passed or not, and the best so far
  std::vector<std::string> advice;  // likewise
  bool can_go_on = false;           // one practises alone: leave, repeat, next
  unsigned picture = 0;             // a texture's name; 0: there is none
  float picture_aspect = 1;         // height over width
};

// An instructor leads with these.
struct HudHand {
  ParticipantSlot slot;
  std::string name;
  bool is_frozen = false;
  std::vector<std::string> instruments;  // by number
};
struct HudConduct {
  bool is_paused = false;
  float rate = 1;                  // simulated time over real time
  std::vector<std::string> marks;  // an empty one has no name
  std::vector<HudHand> hands;      // who has tools
  ParticipantSlot own;             // the instructor's
};

// A tool of one's own, whatever holds it.
struct HudOwnForce {
  std::string name;  // "force on your right hand"
  shape::Colour colour;
  float force_n = 0;
};

// A device that feels, for whoever wants to know more.
struct HudFeltHand {
  FeltHandFigures figures;
  std::vector<float> hand_n, server_n;  // over the last seconds, oldest first
};
inline constexpr std::size_t kFeltBins = 160;  // of them at most

// One of two recordings beside each other.
struct HudHalf {
  std::string name;   // of the file
  std::string organ;  // empty: not known yet
  double seconds = 0, last_seconds = 0;
  std::string stage;    // of a lesson; empty: there is none
  std::string blood;    // lost; empty: none
  std::string notice;   // that it has ended or waits; empty: it plays
  std::string stopped;  // why it cannot go on; empty: it can
  std::vector<HudParticipant> participants;
  std::vector<HudLabel> labels;
  HudRuler ruler;
  float left = 0, width = 0;  // of its picture, pixels
};
struct HudPair {
  std::array<HudHalf, 2> halves;
  bool is_by_stage = false;
  std::optional<bool> has_stages;  // to align by; nothing: it is not known yet
  bool has_own_views = false;
};

struct HudModel {
  std::string title;          // "127.0.0.1:7690", which is a figure for research, or a file's name
  std::string organ;          // "liver"
  std::size_t vertices = 0;   // of its surface
  std::string own_role;       // "surgeon", "instructor, watching", "replay"
  std::string status;         // empty when live; else what it waits for, or why it is over
  std::string status_advice;  // what to do then
  bool is_away = false;       // the picture is old: it is greyed
  wire::FrameFigures figures;
  double session_seconds = 0, round_trip_ms = 0;
  std::optional<double> surface_age_ms;  // of a live session, once it is known
  double pictures_per_second = 0, frames_per_second = 0, bytes_per_second = 0;
  std::string sync_text;  // "in step, CRC 1a2b3c4d"
  bool is_in_step = false;
  std::vector<HudParticipant> participants;
  std::vector<HudLabel> labels;
  std::vector<HudMessage> messages;
  std::vector<HudRuler> rulers;
  std::string measure_text;  // empty: nobody measures
  std::optional<HudTimeline> timeline;
  std::optional<HudPair> pair;  // stands in place of the panels of one session
  float greatest_force_n = 0;   // of all participants' `forces_n`: their common scale
  bool shows_regions = false, shows_holds = false, shows_arrows = false, shows_rate = false;
  std::optional<bool> is_recorded;      // of a live session; nothing: it is not known
  std::string recording_text;           // empty: nothing is wrong with the recording
  bool has_recording_ended = false;     // while the session goes on
  std::string frozen_text;              // empty: one's own tools follow one's hands
  bool has_loan = false;                // an instrument that was handed over and grasps
  std::string view_text;                // empty: there is no view to follow
  std::string lent_text;                // empty: one sees with one's own eyes
  bool can_lend_view = false;           // there is a tool to see with
  std::vector<HudOwnForce> own_forces;  // of a live session
  float own_peak_n = 0;                 // of all of them together, in the last seconds
  std::vector<HudFeltHand> felt_hands;  // shown with the rate
  bool shows_help = false;
  bool has_own_tool = false;
  HudTray tray;
  std::optional<HudLesson> lesson;
  std::string pace_text;              // empty: time goes as usual
  bool is_paused = false;             // no newer picture is to be expected
  std::optional<HudConduct> conduct;  // an instructor's
  bool can_mark = false;  // an instructor's: he may mark the organ and return it to the mark
};

// A person who practises alone wants this after a lesson, or instead of going on with it.
enum class AfterLesson : std::uint8_t { Leave, Repeat, Next };

struct HudActions {
  bool toggle_help = false, toggle_regions = false, toggle_holds = false, toggle_arrows = false;
  bool toggle_rate = false, reset_camera = false, screenshot = false;
  bool toggle_play = false, pause = false;
  bool set_mark = false, return_to_mark = false, toggle_follow = false;
  bool next_lent_view = false;
  bool toggle_measure = false, leave = false;  // leave: what one is in
  bool toggle_alignment = false, toggle_own_views = false;
  bool switch_hand = false;
  bool answer = false, next_stage = false, restart_lesson = false;
  std::optional<AfterLesson> after_lesson;
  std::optional<std::string> mark_named, return_to_named;
  std::optional<replica::LeadWish> lead;
  std::optional<std::size_t> take_instrument;
  std::optional<double> seek_seconds;
  std::optional<float> speed;
};

// A key that went down, as GLFW numbers keys, with the modifiers that were held.
struct KeyPress {
  int code = 0;
  bool has_shift = false, has_control = false;
};

class Hud {
 public:
  // `scale`: of words and panels, kLeastScale to kMostScale; 0: as the monitor says. It is less
  // where the window is too small for it, and the log says so.
  explicit Hud(render::GlContext& context, double scale = 0);
  ~Hud();
  Hud(const Hud&) = delete;
  Hud& operator=(const Hud&) = delete;

  void begin_frame(float seconds);
  device::PointerInput input() const;
  HudActions draw(const HudModel& model);
  // Returns the keys that went down since the last picture, in their order; for what is drawn in
  // place of a model.
  static std::vector<KeyPress> take_keys();
  // Whether Enter went down since the last picture; for what is drawn in place of a model.
  static bool take_enter();
  void render();  // may be repeated: the same again
  // Is told the texts of what is drawn in place of a model; their letters are there with the next
  // picture.
  void need(std::string_view text) { fonts_->need(text); }
  const Fonts& fonts() const { return *fonts_; }

 private:
  void need_letters(const HudModel& model);
  // Draws all panels of one session; returns where they are.
  Sides draw_session(const HudModel& model, HudActions& actions);

  render::GlContext& context_;
  std::optional<Fonts> fonts_;
  const replica::PlaybackStory* read_story_ = nullptr;  // whose letters are there
  float scale_ = 1;
  std::unique_ptr<Box> help_;  // where the keys stood in the last picture
};

}  // namespace trocar::ui
