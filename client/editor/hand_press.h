#pragma once

// The tip that somebody presses with the mouse: a trial of the organ as it is edited, its ticks
// within the pictures, and what the panel says of it. Thread: the main thread.

#include <memory>
#include <span>

#include "client/editor/panel_state.h"
#include "client/render/scene_renderer.h"
#include "common/math/vec3.h"
#include "server/lab/press/press_trial.h"

namespace trocar::editor {

class HandPress {
 public:
  // `version`: of the organ; another one, or another radius, is simulated anew. Lengths in m.
  void begin(const organ::Organ& organ, std::uint64_t version, double radius_m, const Vec3f& place,
             const Vec3f& outward);
  // Simulates as many ticks as `seconds` have, or as fit into a picture; then time goes slower.
  void go_on(double depth_m, float seconds);
  void end();

  bool is_pressed() const { return trial_ && trial_->is_pressed(); }
  // Per node, m; empty: nothing was pressed yet.
  std::span<const Vec3f> displacements() const;
  const PressFigures& figures() const { return figures_; }
  // Adds the tip with its force to a picture, while it is pressed.
  void add_to(render::SceneView& scene) const;

 private:
  std::unique_ptr<press::PressTrial> trial_;
  std::uint64_t version_ = 0;
  float owed_ticks_ = 0;
  PressFigures figures_;
};

}  // namespace trocar::editor
