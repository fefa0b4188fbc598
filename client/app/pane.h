#pragma once

// One session or recording as a part of the window shows it: its surface, tools and lines, the
// camera that sees them, and what is measured there. Thread: render thread.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/app/client_options.h"
#include "client/app/hands.h"
#include "client/app/lent_view.h"
#include "client/render/scene_renderer.h"
#include "client/replica/drawn_lines.h"
#include "client/replica/force_history.h"
#include "client/replica/held_tissue.h"
#include "client/replica/interpolated_surface.h"
#include "client/replica/measured_places.h"
#include "client/ui/hud.h"

namespace trocar::app {

// Null: nobody has it now.
const replica::Participant* owner_of(const replica::Replica& replica, ToolSlot slot);
tool::ToolShape shape_of(const replica::Replica& replica, ToolSlot slot);

struct PaneMeshes {
  shape::MeshVertices drawing, threads;
};

class Pane {
 public:
  // `sees_with`: the name of who holds the tool to see with, once there is one.
  Pane(const render::GlContext& context, std::string sees_with);

  // To be called often: frames pass faster than pictures are drawn.
  void observe(const replica::Replica& replica) { forces_.update(replica); }
  // Moves the surface to `now_ns`. True when there is an organ for the first time; then the camera
  // is framed.
  bool update(const replica::Replica& replica, const StartView& view, std::uint64_t now_ns);
  void frame_camera(const replica::Replica& replica, const StartView& view);
  // Zooms about what is under the pointer, else about the wound that is worked at. The pointer's
  // place counts from the window's left.
  void move_camera(const replica::Replica& replica, const device::PointerInput& input,
                   float seconds);
  // Somebody else says where the camera stands.
  void cease_to_aim() { aims_ = false; }
  struct Look {
    const Overlays& overlays;
    float seconds = 0;  // since the last picture
    bool is_recording = false;
  };
  void make_scene(const replica::Replica& replica, const Hands& hands, const Look& look);
  void set_fineness(float share) { renderer_.set_fineness(share); }
  // Draws into its region.
  void draw(render::Quality quality);
  // The region is the part of the window that it covers.
  void set_region(const render::Region& region) { region_ = region; }
  const render::Region& region() const { return region_; }
  // No time passes from here on.
  void stand_still() { scene_.seconds = 0; }

  // Measures from or to the place at this pixel of the region. False: there is no tissue.
  bool measure_at(const replica::Replica& replica, float x, float y);
  replica::MeasuredPlaces& measured() { return measured_; }
  const replica::MeasuredPlaces& measured() const { return measured_; }
  // These stand in pixels of the window.
  ui::HudRuler ruler() const;
  std::vector<ui::HudLabel> labels(const replica::Replica& replica, bool shows_own) const;

  render::Size size() const { return region_.size; }
  render::OrbitCamera& camera() { return camera_; }
  const render::OrbitCamera& camera() const { return camera_; }
  bool is_framed() const { return is_framed_; }
  LentView& lent() { return lent_; }
  const LentView& lent() const { return lent_; }
  const replica::InterpolatedSurface& surface() const { return surface_; }
  const replica::ForceHistory& forces() const { return forces_; }
  const render::SceneView& scene() const { return scene_; }
  const render::SceneRenderer& renderer() const { return renderer_; }

 private:
  render::SceneTool scene_tool(const replica::Replica& replica, const replica::Tool& tool,
                               const Hands& hands) const;
  std::vector<render::Hold> holds(const replica::Replica& replica, bool shows_holds);
  void add_lines(const replica::Replica& replica);
  // The middle of the newest wound; none: nobody has cut.
  std::optional<Vec3f> worked_wound(const replica::Replica& replica) const;
  void aim(const replica::Replica& replica, float share);
  void find_lent_view(const replica::Replica& replica, bool is_recording);
  // Returns where the point is that a lesson's hands follow.
  static std::optional<Vec3f> lesson_target(const replica::Replica& replica);

  render::Region region_;
  render::SceneRenderer renderer_;
  render::OrbitCamera camera_;
  replica::InterpolatedSurface surface_;
  replica::ForceHistory forces_;
  bool is_framed_ = false;  // the camera, when there is an organ
  bool aims_ = false;       // at the wound that is worked at, until somebody moves the view
  std::uint64_t now_ns_ = 0;
  LentView lent_;
  std::string sees_with_;
  replica::DrawnLines lines_;
  PaneMeshes meshes_;  // of the last picture
  replica::HeldTissue held_;
  std::uint64_t held_history_ = 0;
  replica::MeasuredPlaces measured_;
  render::SceneView scene_;  // of the last picture; its spans need the replica
};

}  // namespace trocar::app
