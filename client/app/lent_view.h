#pragma once

// This says which tool a person sees with: an endoscope in a session, any tool in a recording.
// Thread: render thread.

#include <optional>

#include "client/render/scene_renderer.h"

namespace trocar::app {

class LentView {
 public:
  // Goes on to the next one, and after the last to the person's own view. The numbers of tools say
  // which is next.
  void next(const std::vector<render::SceneTool>& tools, bool is_recording);
  void choose(ToolSlot slot) { slot_ = slot; }
  void leave() { slot_.reset(); }
  const std::optional<ToolSlot>& slot() const { return slot_; }
  // Lets the camera see with the tool, and leaves an endoscope out of its own picture. A tool that
  // is gone, or has become one that nobody sees with, gives the camera back.
  void apply(render::SceneView& scene, render::OrbitCamera& camera, bool is_recording);

 private:
  std::optional<ToolSlot> slot_;
};

}  // namespace trocar::app
