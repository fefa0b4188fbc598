#include "client/device/mouse_tool.h"

#include <algorithm>
#include <cmath>

namespace trocar::device {
namespace {

constexpr float kWheelMetres = 0.003f;  // per notch
constexpr float kKeyMetresPerSecond = 0.05f;
constexpr float kFineFactor = 0.25f;     // with Shift
constexpr float kSettleSeconds = 0.06f;  // hovering follows the relief this softly
// How far below the surface each verb begins, m, and how fast the tip goes there, m/s.
constexpr float kPushDepth = 0.006f, kGraspDepth = 0.001f, kCutDepth = 0.012f;
constexpr float kPushSpeed = 0.04f, kReachSpeed = 0.1f;
constexpr float kMinDepth = 0.02f, kMaxDepth = 1.8f;

float depth_of(tool::Verb verb) {
  switch (verb) {
    case tool::Verb::Push:
      return kPushDepth;
    case tool::Verb::Grasp:
      return kGraspDepth;
    case tool::Verb::Cut:
      return kCutDepth;
    case tool::Verb::None:
      break;
  }
  return 0;
}

}  // namespace

void MouseTool::update(const PointerInput& input, const ViewRays& view,
                       std::span<const Vec3f> positions, Triangles triangles, float seconds) {
  const bool is_camera = input.right || input.middle;
  tool::Verb verb = tool::Verb::None;
  if (input.cut)
    verb = tool::Verb::Cut;
  else if (input.grasp)
    verb = tool::Verb::Grasp;
  else if (input.push || (input.left && (input.is_over_scene || wanted_ == tool::Verb::Push)))
    verb = tool::Verb::Push;

  const bool begins = verb != tool::Verb::None && wanted_ == tool::Verb::None;
  wanted_ = verb;
  if (begins) ahead_ = std::max(0.0f, hover_ + depth_of(verb));
  if (verb == tool::Verb::None) ahead_ = 0;

  if (is_camera || (!input.is_over_scene && verb == tool::Verb::None)) {
    // A verb that is held goes on holding; the depth is that of the tip seen from the new view.
    sample_.verb = is_valid_ && !is_reaching() ? verb : tool::Verb::None;
    depth_ = dot(sample_.world_from_tool.position - view.eye, view.forward);
    return;
  }
  const Vec3f ray = view.ray_through(input.x, input.y);
  const float fine = input.shift ? kFineFactor : 1.0f;
  float advance = input.control ? 0.0f : input.wheel * kWheelMetres * fine;
  if (input.deeper) advance += kKeyMetresPerSecond * fine * seconds;
  if (input.nearer) advance -= kKeyMetresPerSecond * fine * seconds;
  if (verb == tool::Verb::None) {
    hover_ = std::clamp(hover_ - advance, -0.03f, 0.15f);
    if (const auto depth = pick(positions, triangles, view.eye, ray)) {
      const float wanted = *depth - hover_;
      const float share = is_valid_ ? 1 - std::exp(-seconds / kSettleSeconds) : 1.0f;
      depth_ += (wanted - depth_) * share;
    } else if (!is_valid_) {
      depth_ = std::max(-dot(view.eye, view.forward), kMinDepth);  // the organ's centre
    }
  } else {
    const float speed = verb == tool::Verb::Push ? kPushSpeed : kReachSpeed;
    const float step = std::min(ahead_, speed * seconds);
    ahead_ -= step;
    depth_ += advance + step;
  }
  depth_ = std::clamp(depth_, kMinDepth, kMaxDepth);
  const Vec3f tip = view.eye + ray * depth_;
  if (length(tip) > 1.9f) return;  // the server ends a session for poses beyond 2 m
  // The shaft goes through a port above the camera, on the side of the hand.
  const Vec3f port = view.eye + view.up * 0.16f + view.right * 0.14f;
  sample_.world_from_tool.position = tip;
  sample_.world_from_tool.orientation = rotation_from_z(normalized(port - tip, Vec3f{0, 0, 1}));
  sample_.verb = is_reaching() ? tool::Verb::None : verb;
  is_valid_ = true;
}

std::optional<tool::ToolSample> MouseTool::pop_due(std::uint64_t now_ns) {
  if (!is_valid_) return std::nullopt;
  const std::uint64_t since = now_ns - last_sent_ns_;
  const bool is_due = last_sent_ns_ == 0 || since >= kKeepAliveNs ||
                      (since >= kSampleIntervalNs && !(sample_ == last_sent_));
  if (!is_due) return std::nullopt;
  last_sent_ = sample_;
  last_sent_ns_ = now_ns;
  return sample_;
}

}  // namespace trocar::device
