#pragma once

// The panels of a session: what they say is read from the replica, the source of its messages and a
// pane, and kept nowhere. Thread: render thread.

#include <vector>

#include "client/app/hands.h"
#include "client/app/pane.h"
#include "client/render/image_texture.h"
#include "client/ui/hud.h"

namespace trocar::app {

// Somebody looks at a session, or at a recording of one.
struct Onlooker {
  replica::Role role = replica::Role::Observer;  // before the server has said one
  bool is_replay = false;
  bool practises = false;  // alone, in a session that this client has started
};

std::vector<ui::HudParticipant> participants_of(const replica::Replica& replica, const Pane& pane,
                                                bool is_replay);
ui::HudTray tray_of(const Hands::Choice& choice);

void add_person(const replica::Replica& replica, const Onlooker& onlooker, bool follows_view,
                ui::HudModel& model);
// Says why there is no organ to be seen, if so.
void add_connection(const replica::SessionSource& source, bool has_organ, ui::HudModel& model);
void add_figures(const replica::Replica& replica, const replica::SessionSource& source,
                 std::uint64_t now_ns, ui::HudModel& model);
void add_recording(const replica::Replica& replica, bool is_replay, ui::HudModel& model);
void add_own_forces(const replica::Replica& replica, const Pane& pane, ui::HudModel& model);
void add_lent_view(const replica::Replica& replica, const Pane& pane, bool is_replay,
                   ui::HudModel& model);
void add_messages(const replica::Replica& replica, std::uint64_t now_ns, ui::HudModel& model);
void add_timeline(const replica::PlaybackControl& playback, bool is_measuring, ui::HudModel& model);
// `image` is the picture of the stage, if it has one.
// `best_before`: points of the best attempt before this one.
void add_lesson(const replica::Replica& replica, const render::ImageTexture& image,
                const Onlooker& onlooker, std::optional<float> best_before, ui::HudModel& model);
void add_pace(const replica::Replica& replica, bool is_replay, ui::HudModel& model);

}  // namespace trocar::app
