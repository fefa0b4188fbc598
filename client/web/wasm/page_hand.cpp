#include "client/web/wasm/page_hand.h"

#include <cmath>

namespace trocar::wasm {
namespace {

bool is_set(float flag) {
  return flag != 0;
}

}  // namespace

device::PointerInput PageHands::pointer() const {
  const auto& in = input_;
  return {.x = in.x,
          .y = in.y,
          .dx = in.x - last_[0],
          .dy = in.y - last_[1],
          .wheel = in.wheel,
          .is_over_scene = is_set(in.is_over_scene),
          .left = is_set(in.left),
          .right = is_set(in.camera),
          .control = is_set(in.control),
          .shift = is_set(in.shift),
          .push = is_set(in.push),
          .grasp = is_set(in.grasp),
          .cut = is_set(in.cut),
          .deeper = is_set(in.deeper),
          .nearer = is_set(in.nearer),
          .roll_left = is_set(in.roll_left),
          .roll_right = is_set(in.roll_right)};
}

device::ViewRays PageHands::view() const {
  const auto& in = input_;
  return {.eye = in.eye,
          .right = in.right,
          .up = in.up,
          .forward = in.forward,
          .tan_half_height = in.tan_half_height,
          .width = std::max(in.width, 1.0f),
          .height = std::max(in.height, 1.0f)};
}

void PageHands::take(int hand, const tool::ToolShape& shape) {
  tool(hand).take(shape);
}

void PageHands::switch_to(int hand) {
  if (hand == moved_) return;
  tool(moved_).leave();
  moved_ = hand;
  tool(moved_).come_back(pointer(), view());
}

void PageHands::update(std::span<const Vec3f> positions, device::Triangles triangles,
                       float seconds) {
  tool(moved_).update(pointer(), view(), positions, triangles, seconds);
  last_ = {input_.x, input_.y};
}

const PageHandSample* PageHands::sample(int hand, double now_ms) {
  auto& held = tool(hand);
  if (!held.is_valid()) return nullptr;
  const auto now_ns = static_cast<std::uint64_t>(std::max(now_ms, 0.0) * 1e6) + 1;
  const auto due = held.pop_due(now_ns);
  const auto& [pose, verb] = held.current();
  sample_ = {.is_due = due ? 1.0f : 0.0f,
             .verb = static_cast<float>(static_cast<int>(verb)),
             .tip = pose.position,
             .orientation = pose.orientation};
  return &sample_;
}

}  // namespace trocar::wasm
