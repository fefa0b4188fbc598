#pragma once

// The parts of the HUD, each drawn with Dear ImGui between NewFrame and Render. `scale` is pixels
// per design pixel.

#include <span>

#include "client/ui/hud.h"
#include "client/ui/rate_text.h"

namespace trocar::ui {

// A part of the screen, pixels; nothing drawn: all 0.
struct Box {
  float left = 0, top = 0, right = 0, bottom = 0;
};

// These return where they are.
Box draw_session_panel(const HudModel& model, float scale);
Box draw_participants_panel(const HudModel& model, float scale);
// All that is not as it should be, and the messages, at the top between these two panels, or under
// `top` pixels.
Box draw_banners(const HudModel& model, const Box& session, const Box& people, float scale,
                 float top = 0);
// People and their doings, a line each; `greatest_n` is the scale of their plots.
void draw_people(std::span<const HudParticipant> people, float greatest_n, bool shows_rate,
                 float scale);
// Two recordings: what each is, where it is, and who does what.
void draw_pair(const HudModel& model, float scale);
// The lesson's stage, under the panel of people; returns where both are.
Box draw_lesson(const HudLesson& lesson, const Box& people, float scale, HudActions& actions);
// Blood lost, under the panels above; returns where all of them are.
Box draw_blood(const wire::BloodFigures& blood, const Box& above, float scale);
// A bar at the bottom shows the force that one's own tools meet.
void draw_own_forces(const HudModel& model, float scale);
// A panel says what devices render; `top`: where on the screen there is room from.
void draw_felt_hands(const HudModel& model, float top, float scale);
// Names at tools; one that the banners would cover stands under them.
void draw_labels(std::span<const HudLabel> labels, const Box& banners, float scale);
void draw_ruler(const HudRuler& ruler, float scale);
// The instruments of one's own, to be chosen from, under the panels above. Where the session's is
// tall, with the figures for research, only what the hand has.
void draw_tray(const HudModel& model, const Box& above, float scale, HudActions& actions);
// An instructor's buttons, under the session's panel.
Box draw_conduct(const HudConduct& conduct, const Box& session, float scale, HudActions& actions);
// Needs a model with a timeline; returns where it is.
Box draw_timeline(const HudModel& model, float scale, HudActions& actions);
// These are the panels of one session at both sides.
struct Sides {
  Box left, right;
};
// Stands at the right above the timeline, if there is one. Of a recording it goes to the left,
// where as tall as it was `before` it would cover the panels at the right, and less at the left.
// Returns where it is.
Box draw_help(const HudModel& model, const Box& timeline, const Sides& sides, const Box& before,
              float scale);
// Greys the scene, which is no longer what the session is.
void draw_away_veil();

// "1:02.5"
std::string clock_text(double seconds);
// "12.3 kB/s"
std::string byte_rate(double bytes_per_second);

}  // namespace trocar::ui
