#include "client/app/lent_view.h"

#include <algorithm>

namespace trocar::app {
namespace {

bool can_see(const render::SceneTool& shown, bool is_recording) {
  return is_recording || tool::is_endoscope(shown.shape.form);
}

}  // namespace

void LentView::next(const std::vector<render::SceneTool>& tools, bool is_recording) {
  std::optional<ToolSlot> following;
  for (const auto& shown : tools) {
    if (!can_see(shown, is_recording) || (slot_ && shown.slot.value <= slot_->value)) continue;
    if (!following || shown.slot.value < following->value) following = shown.slot;
  }
  slot_ = following;
}

void LentView::apply(render::SceneView& scene, render::OrbitCamera& camera, bool is_recording) {
  camera.look_through({});
  if (!slot_) return;
  const auto shown = std::ranges::find(scene.tools, *slot_, &render::SceneTool::slot);
  if (shown == scene.tools.end() || !can_see(*shown, is_recording)) return;
  camera.look_through(shape::lens_of(shown->world_from_tool, shown->shape));
  if (tool::is_endoscope(shown->shape.form)) scene.tools.erase(shown);
}

}  // namespace trocar::app
