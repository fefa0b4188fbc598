#include "client/shape/lens.h"

#include <cmath>

namespace trocar::shape {
namespace {

constexpr float kTanHalfScope = 0.7002f;  // 70 degrees
constexpr float kTanHalfBehind = 0.4142f;
constexpr float kBehind_m = 0.11f, kAbove_m = 0.035f;  // the tip, for other instruments
constexpr float kSin30 = 0.5f, kCos30 = 0.8660254f;

}  // namespace

Lens lens_of(const Pose& world_from_tool, const tool::ToolShape& shape) {
  const Vec3f back = rotate(world_from_tool.orientation, {0, 0, 1});
  const Vec3f side = rotate(world_from_tool.orientation, {0, 1, 0});
  Lens lens;
  lens.is_endoscope = tool::is_endoscope(shape.form);
  lens.forward = -back;
  if (shape.form == tool::Form::Endoscope30) lens.forward = side * kSin30 - back * kCos30;
  const auto upright = [&](const Vec3f& up) { return up - lens.forward * dot(up, lens.forward); };
  // Nearly straight up or down there is no upright: the tool says what is above.
  const Vec3f up = upright({0, 1, 0});
  lens.up = normalized(length(up) > 0.05f ? up : upright(side), upright(side));
  lens.tan_half_height = lens.is_endoscope ? kTanHalfScope : kTanHalfBehind;
  lens.eye = world_from_tool.position - back * (lens.is_endoscope ? shape.radius_m : 0.0f);
  if (!lens.is_endoscope) lens.eye = lens.eye + back * kBehind_m + lens.up * kAbove_m;
  return lens;
}

}  // namespace trocar::shape
