#pragma once

// The hands of a person at the page: mouse and keys move them by the rules of the native client
// (client/device/mouse_tool.h), over the picture that the page shows.

#include <array>
#include <cstdint>

#include "client/device/mouse_tool.h"
#include "common/base/ids.h"

namespace trocar::wasm {

// How the screen lies in the world, and what mouse and keys do now: JavaScript writes this as one
// array of floats. Flags are 0 or 1.
struct PageHandInput {
  Vec3f eye, right, up, forward;                     // m; unit vectors
  float tan_half_height = 0, width = 0, height = 0;  // pixels
  float x = 0, y = 0;                                // pixels
  float wheel = 0;                                   // notches, away from the person positive
  float is_over_scene = 0, left = 0, camera = 0, shift = 0, control = 0;
  float push = 0, grasp = 0, cut = 0, deeper = 0, nearer = 0, roll_left = 0, roll_right = 0;
};
static_assert(sizeof(PageHandInput) == 30 * sizeof(float));

// A sample as JavaScript reads it.
struct PageHandSample {
  float is_due = 0, verb = 0;
  Vec3f tip;  // m
  Quatf orientation;
};
static_assert(sizeof(PageHandSample) == 9 * sizeof(float));

class PageHands {
 public:
  PageHandInput& input() { return input_; }

  // The hand has another instrument, and lets go.
  void take(int hand, const tool::ToolShape& shape);
  // The input moves that hand; it was another one's until now.
  void switch_to(int hand);
  void update(std::span<const Vec3f> positions, device::Triangles triangles, float seconds);
  // Null: the pointer was not over the picture yet. is_due: it is to be sent.
  const PageHandSample* sample(int hand, double now_ms);

 private:
  device::MouseTool& tool(int hand) { return tools_[hand == 0 ? 0 : 1]; }
  device::PointerInput pointer() const;
  device::ViewRays view() const;

  PageHandInput input_;
  std::array<device::MouseTool, kToolsPerHand> tools_{
      device::MouseTool(tool::ToolShape{}, device::MouseTool::Side::Right),
      device::MouseTool(tool::ToolShape{}, device::MouseTool::Side::Left)};
  int moved_ = 0;
  std::array<float, 2> last_{};
  PageHandSample sample_;
};

}  // namespace trocar::wasm
