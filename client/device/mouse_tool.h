#pragma once

// Mouse and keyboard as an instrument.
//
//   no verb held     the tip follows the pointer and hovers above the tissue under it; the wheel
//                    sets the height
//   left button      what the instrument is for: a grasper grasps, what has an edge cuts, and all
//                    others push
//   F                push: the tip goes down and presses 6 mm in; it moves in the view plane, and
//                    wheel or W/S press in and draw back
//   Space            grasp: the tip goes down, closes where the surface is, and moves like that
//   X                cut: the edge goes in and follows the pointer, wheel or W/S change how deep;
//                    scissors and grasps begin once they are there
//   Q, E             turn it about its shaft
//   right or middle  the camera's; the tip stays where it is
//
// A person with two hands moves one at a time. The other stays, and goes on holding what it holds;
// when the pointer comes back to it, it moves from where it is, and holds until it is told to again
// and let go.
//
// Whoever looks through the own endoscope holds it outside, behind the port that its shaft passes:
// moving the mouse to the right moves that handle to the right, and so the picture to the left. The
// wheel, or W and S, go in and out, and Q and E turn it.
//
// Depth is measured along the view direction. The shaft runs from the tip towards a fixed port
// above and beside the camera, as an instrument through a trocar does. Samples leave at most every
// 8 ms while something changes, else every 40 ms (the server's lease wants one at least every 50
// ms). Thread: render thread.

#include <array>
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
  enum class Side { Right, Left };
  explicit MouseTool(const tool::ToolShape& shape, Side side = Side::Right)
      : shape_(shape), side_(side == Side::Right ? 1.0f : -1.0f) {}

  // It lets go of everything and is another instrument.
  void take(const tool::ToolShape& shape);
  const tool::ToolShape& shape() const { return shape_; }
  // The pointer leaves it for the person's other hand, and comes back to it.
  void leave();
  void come_back(const PointerInput& input, const ViewRays& view);

  // Once per display frame; `seconds` since the last one. Positions are those on the screen.
  void update(const PointerInput& input, const ViewRays& view, std::span<const Vec3f> positions,
              Triangles triangles, float seconds);
  // Does so once per display frame for a holder who looks through it.
  void steer(const PointerInput& input, const ViewRays& view, float seconds);
  // The holder looks at it from outside again.
  void cease_to_steer() { port_.reset(); }
  // The pose and verb now; invalid until the pointer was over the scene once.
  const tool::ToolSample& current() const { return sample_; }
  bool is_valid() const { return is_valid_; }
  // A sample if one is due.
  std::optional<tool::ToolSample> pop_due(std::uint64_t now_ns);

 private:
  tool::Verb verb_of(const PointerInput& input);
  float depth_of(tool::Verb verb) const;
  // Jaws and scissors stay open on the way to the surface.
  bool is_reaching() const;
  void turn(const PointerInput& input, float seconds);
  void point_shaft(const Vec3f& tip, const Vec3f& port);

  tool::ToolShape shape_;
  float side_;  // 1: its port is at the right of the view, -1: at the left
  tool::ToolSample sample_;
  tool::ToolSample last_sent_;
  std::uint64_t last_sent_ns_ = 0;
  bool is_valid_ = false;
  tool::Verb wanted_ = tool::Verb::None;  // what keys and buttons ask for
  float depth_ = 0;                       // m along the view direction
  float ahead_ = 0;                       // m, still to go down for what is wanted
  float hover_ = 0.008f;                  // m above the tissue while no verb is held
  bool is_latched_ = false;               // it goes on holding without a key
  bool was_pressed_ = false;
  bool is_for_other_hand_ = false;  // what is pressed was pressed before it came back
  std::array<float, 2> aside_{};    // pixels, from the pointer to where the tip goes
  float roll_ = 0;                  // rad, about the shaft
  std::optional<Vec3f> port_;       // that an endoscope's shaft passes while it is steered
};

}  // namespace trocar::device
