#include "client/device/mouse_tool.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace trocar::device {
namespace {

constexpr float kWheelMetres = 0.003f;  // per notch
constexpr float kKeyMetresPerSecond = 0.05f;
constexpr float kFineFactor = 0.25f;     // with Shift
constexpr float kSettleSeconds = 0.06f;  // hovering follows the relief this softly
// How far below the surface each verb begins, m, and how fast the tip goes there, m/s.
constexpr float kPushDepth = 0.006f, kGraspDepth = 0.001f, kCutDepth = 0.012f;
constexpr float kHookDepth = 0.004f, kTouchDepth = 0.001f;
constexpr float kRollSpeed = 1.6f;      // rad/s
constexpr float kAsideSeconds = 0.15f;  // a tip that is free comes to the pointer this softly
constexpr float kPushSpeed = 0.04f, kReachSpeed = 0.1f;
constexpr float kPortMetres = 0.14f, kLeastInside = 0.03f;  // of a steered shaft
constexpr float kSwingPerPixel = 0.0022f;                   // rad
constexpr float kMinDepth = 0.02f, kMaxDepth = 1.8f;
constexpr float kLeastHover = 0.001f;  // m

}  // namespace

float MouseTool::depth_of(tool::Verb verb) const {
  switch (verb) {
    case tool::Verb::Push:
      return shape_.form == tool::Form::Suction || shape_.form == tool::Form::Coagulator
                 ? kTouchDepth
                 : kPushDepth;
    case tool::Verb::Grasp:
      return kGraspDepth;
    case tool::Verb::Cut:
      return shape_.form == tool::Form::Hook ? kHookDepth : kCutDepth;
    case tool::Verb::None:
      break;
  }
  return 0;
}

bool MouseTool::is_reaching() const {
  const bool waits = wanted_ == tool::Verb::Grasp ||
                     (wanted_ == tool::Verb::Cut && shape_.form == tool::Form::Scissors);
  return waits && ahead_ > 0;
}

void MouseTool::take(const tool::ToolShape& shape) {
  shape_ = shape;
  wanted_ = sample_.verb = tool::Verb::None;
  ahead_ = 0;
  is_latched_ = false;
  port_.reset();
}

void MouseTool::leave() {
  is_latched_ = wanted_ == tool::Verb::Grasp && !is_reaching();
  if (is_latched_) return;
  wanted_ = sample_.verb = tool::Verb::None;
  ahead_ = 0;
}

void MouseTool::come_back(const PointerInput& input, const ViewRays& view) {
  was_pressed_ = is_for_other_hand_ = input.left || input.push || input.grasp || input.cut;
  if (!is_valid_) return;
  const auto seen = view.pixel_of(sample_.world_from_tool.position);
  aside_ = {seen[0] - input.x, seen[1] - input.y};
  depth_ = dot(sample_.world_from_tool.position - view.eye, view.forward);
}

tool::Verb MouseTool::verb_of(const PointerInput& input) {
  const bool is_left = input.left && (input.is_over_scene || wanted_ != tool::Verb::None);
  const bool is_pressed = is_left || input.push || input.grasp || input.cut;
  const bool was_pressed = std::exchange(was_pressed_, is_pressed);
  if (is_pressed && !was_pressed) is_latched_ = false;
  if (!is_pressed) is_for_other_hand_ = false;
  if (is_latched_) return tool::Verb::Grasp;
  auto verb = tool::Verb::None;
  if (is_for_other_hand_) return verb;
  if (input.cut)
    verb = tool::Verb::Cut;
  else if (input.grasp)
    verb = tool::Verb::Grasp;
  else if (input.push)
    verb = tool::Verb::Push;
  else if (is_left)
    verb = tool::main_verb(shape_);
  return tool::possible(shape_, verb);
}

void MouseTool::turn(const PointerInput& input, float seconds) {
  const float way = (input.shift ? kFineFactor : 1.0f) * kRollSpeed * seconds;
  if (input.roll_left) roll_ += way;
  if (input.roll_right) roll_ -= way;
}

void MouseTool::update(const PointerInput& input, const ViewRays& view,
                       std::span<const Vec3f> positions, Triangles triangles, float seconds) {
  const bool is_camera = input.right || input.middle;
  const tool::Verb verb = verb_of(input);
  turn(input, seconds);
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
  if (verb == tool::Verb::None)
    for (auto& pixels : aside_) pixels *= std::exp(-seconds / kAsideSeconds);
  const Vec3f ray = view.ray_through(input.x + aside_[0], input.y + aside_[1]);
  const float fine = input.shift ? kFineFactor : 1.0f;
  float advance = input.control ? 0.0f : input.wheel * kWheelMetres * fine;
  if (input.deeper) advance += kKeyMetresPerSecond * fine * seconds;
  if (input.nearer) advance -= kKeyMetresPerSecond * fine * seconds;
  if (verb == tool::Verb::None) {
    // Without a verb it stays out of the tissue: in there it would touch nothing.
    hover_ = std::clamp(hover_ - advance, kLeastHover, 0.15f);
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
  const Vec3f port = view.eye + view.up * 0.16f + view.right * (side_ * 0.14f);
  point_shaft(tip, port);
  sample_.verb = is_reaching() ? tool::Verb::None : verb;
  is_valid_ = true;
}

void MouseTool::point_shaft(const Vec3f& tip, const Vec3f& port) {
  sample_.world_from_tool.position = tip;
  sample_.world_from_tool.orientation = rotation_from_z(normalized(port - tip, Vec3f{0, 0, 1})) *
                                        Quatf{0, 0, std::sin(0.5f * roll_), std::cos(0.5f * roll_)};
}

void MouseTool::steer(const PointerInput& input, const ViewRays& view, float seconds) {
  if (!is_valid_) return;
  const Vec3f tip = sample_.world_from_tool.position;
  const Vec3f back = rotate(sample_.world_from_tool.orientation, {0, 0, 1});
  if (!port_) port_ = tip + back * kPortMetres;
  turn(input, seconds);
  wanted_ = sample_.verb = tool::Verb::None;
  const float fine = input.shift ? kFineFactor : 1.0f;
  float advance = input.control ? 0.0f : input.wheel * kWheelMetres * fine;
  if (input.deeper) advance += kKeyMetresPerSecond * fine * seconds;
  if (input.nearer) advance -= kKeyMetresPerSecond * fine * seconds;
  const float inside =
      std::clamp(length(*port_ - tip) + advance, kLeastInside, shape_.length_m - kLeastInside);
  const float swing = input.is_over_scene ? kSwingPerPixel * fine : 0.0f;
  const Vec3f handle = back + view.right * (input.dx * swing) - view.up * (input.dy * swing);
  const Vec3f moved = *port_ - normalized(handle, back) * inside;
  if (length(moved) > 1.9f) return;
  point_shaft(moved, *port_);
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
