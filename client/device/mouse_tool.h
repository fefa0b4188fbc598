#pragma once

// Mouse and keyboard as an instrument.
//
//   no verb held     the tip follows the pointer and hovers above the tissue under it; the wheel
//                    sets the height
//   left button, F   push: the tip goes down and presses 6 mm in; it moves in the view plane, and
//                    wheel or W/S press in and draw back
//   Space            grasp: the tip goes down, closes where the surface is, and moves like that
//   X                cut: the blade goes in 12 mm and follows the pointer, wheel or W/S change that
//   right or middle  the camera's; the tip stays where it is
//
// Depth is measured along the view direction. The shaft runs from the tip towards a fixed port
// above and beside the camera, as an instrument through a trocar does. Samples leave at most every
// 8 ms while something changes, else every 40 ms (the server's lease wants one at least every 50
// ms). Thread: render thread.

#include <optional>
#include <span>

#include "client/device/ray_pick.h"
#include "client/device/view_rays.h"
#include "common/tool/tool.h"

namespace trocar::device {

inline constexpr std::uint64_t kSampleIntervalNs = 8'000'000;
inline constexpr std::uint64_t kKeepAliveNs = 40'000'000;

class MouseTool {
 public:
  explicit MouseTool(const tool::ToolShape& shape) : shape_(shape) {}

  // Once per display frame; `seconds` since the last one. Positions are those on the screen.
  void update(const PointerInput& input, const ViewRays& view, std::span<const Vec3f> positions,
              Triangles triangles, float seconds);
  // The pose and verb now; invalid until the pointer was over the scene once.
  const tool::ToolSample& current() const { return sample_; }
  bool is_valid() const { return is_valid_; }
  // A sample if one is due.
  std::optional<tool::ToolSample> pop_due(std::uint64_t now_ns);

 private:
  // Jaws stay open on the way to the surface.
  bool is_reaching() const { return wanted_ == tool::Verb::Grasp && ahead_ > 0; }

  tool::ToolShape shape_;
  tool::ToolSample sample_;
  tool::ToolSample last_sent_;
  std::uint64_t last_sent_ns_ = 0;
  bool is_valid_ = false;
  tool::Verb wanted_ = tool::Verb::None;  // what keys and buttons ask for
  float depth_ = 0;                       // m along the view direction
  float ahead_ = 0;                       // m, still to go down for what is wanted
  float hover_ = 0.008f;                  // m above the tissue while no verb is held
};

}  // namespace trocar::device
