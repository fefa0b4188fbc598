#pragma once

// The window of trocar-organ edit: an organ as the client draws it, the brush on it, and the panel.
// Thread: the main thread.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "client/editor/hand_press.h"
#include "client/editor/organ_view.h"
#include "client/editor/panel.h"
#include "client/render/camera.h"
#include "client/render/gl_context.h"
#include "client/render/scene_renderer.h"
#include "client/ui/hud.h"
#include "server/organs/edit/editor.h"
#include "server/organs/edit/surface_brush.h"

namespace trocar::editor {

struct WindowSettings {
  render::Size size{1280, 800};
  double scale = 0;  // of words and panels; 0: as the monitor says
  std::string file;  // that is offered when it is saved
  std::vector<material::HyperelasticMaterial> materials;  // that can be chosen
};

class EditorWindow {
 public:
  // The editor outlives the window. Error: there is no display, or no OpenGL 3.3.
  static Result<std::unique_ptr<EditorWindow>> open(edit::Editor& editor,
                                                    const WindowSettings& settings);

  // Draws one picture and acts on what the person has done since the last one. `seconds`: since
  // then.
  void draw(float seconds);
  // The person has closed it, and nothing is lost.
  bool is_over() const { return is_over_; }

 private:
  EditorWindow(edit::Editor& editor, const WindowSettings& settings,
               std::unique_ptr<render::GlContext> context);

  void take_keys();
  void act(const PanelActions& actions);
  void paint(const device::PointerInput& input);
  void press(const device::PointerInput& input, float seconds);
  void dab(const edit::SurfacePlace& place, bool takes_away);
  void dab_region(const edit::SurfacePlace& place, bool takes_away);
  // A new region of these nodes with the name in the panel. False: it cannot be, or not yet.
  bool begin_region(std::span<const NodeIndex> nodes, bool says_why);
  void use_box(bool takes_away);
  void use_material();
  void save(bool may_replace);
  void end_stroke();
  void draw_brush(const device::PointerInput& input);
  void follow_organ();
  void take_picture();
  void ask_for_end();

  edit::Editor& editor_;
  std::vector<material::HyperelasticMaterial> materials_;
  std::unique_ptr<render::GlContext> context_;
  render::SceneRenderer renderer_;
  ui::Hud hud_;
  OrganView view_;
  HandPress press_;
  edit::SurfaceBrush brush_;
  render::OrbitCamera camera_;
  render::Region region_;  // of the organ's picture, beside the panel
  PanelState state_;
  PanelFigures figures_;
  std::uint64_t seen_version_ = 0;
  bool is_stroke_ = false, was_left_ = false, was_pressing_ = false;
  float last_x_ = 0, last_y_ = 0;        // of the pointer in a stroke, pixels
  std::vector<NodeIndex> stroke_nodes_;  // of a region that begins
  std::string saved_file_;               // which this window may write again without a question
  bool wants_picture_ = false, is_over_ = false;
};

}  // namespace trocar::editor
