#pragma once

// The parts of the HUD, each drawn with Dear ImGui between NewFrame and Render. `scale` is pixels
// per design pixel.

#include "client/ui/hud.h"
#include "client/ui/rate_text.h"

namespace trocar::ui {

void draw_session_panel(const HudModel& model, float scale);
// Returns where on the screen it ends.
float draw_participants_panel(const HudModel& model, float scale);
// A bar at the bottom shows the force that one's own tools meet.
void draw_own_forces(const HudModel& model, float scale);
// A panel says what devices render; `top`: where on the screen there is room from.
void draw_felt_hands(const HudModel& model, float top, float scale);
// A banner while simulated time runs slower than real time.
void draw_slow_time(const HudModel& model, float scale);
// Says what is wrong with the recording, as long as the session lasts.
void draw_recording(const HudModel& model, float scale);
// A banner while the picture is older than a hand can work with.
void draw_stale_picture(const HudModel& model, float scale);
// Who keeps one's tools where they are, and whose view there is to follow.
void draw_lesson(const HudModel& model, float scale);
void draw_labels(const HudModel& model, float scale);
void draw_messages(const HudModel& model, float scale);
// The instruments of one's own, to be chosen from, at the left edge.
void draw_tray(const HudTray& tray, float scale, HudActions& actions);
void draw_timeline(const HudTimeline& timeline, float scale, HudActions& actions);
void draw_help(const HudModel& model, float scale);
void draw_status(const HudModel& model, float scale);
// Greys the scene, which is no longer what the session is.
void draw_away_veil();

// "12.3 kB/s"
std::string byte_rate(double bytes_per_second);

}  // namespace trocar::ui
