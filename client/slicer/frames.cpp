#include "client/slicer/frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace trocar::slicer {
namespace {

constexpr double kMillimetres = 1e3;

// Its axes are columns; they are at right angles and of unit length.
Quatf quaternion_of(const std::array<Vec3f, 3>& axis) {
  const auto [x, y, z] = axis;
  const std::array<float, 4> squares{1 + x.x - y.y - z.z, 1 - x.x + y.y - z.z, 1 - x.x - y.y + z.z,
                                     1 + x.x + y.y + z.z};
  const auto greatest = std::max_element(squares.begin(), squares.end()) - squares.begin();
  Quatf q;
  switch (greatest) {
    case 0:
      q = {squares[0], x.y + y.x, x.z + z.x, y.z - z.y};
      break;
    case 1:
      q = {x.y + y.x, squares[1], y.z + z.y, z.x - x.z};
      break;
    case 2:
      q = {x.z + z.x, y.z + z.y, squares[2], x.y - y.x};
      break;
    default:
      q = {y.z - z.y, z.x - x.z, x.y - y.x, squares[3]};
  }
  return normalized(q);
}

Error refused(const std::string& what) {
  return {ErrorCode::Refused, what};
}

}  // namespace

Vec3f Frames::to_ras_mm(const Vec3f& world_m) const {
  const Vec3d p = (to_double(world_m) + offset_m_) * kMillimetres;
  return to_float(Vec3d{-p.x, p.z, p.y});
}

Transform Frames::to_ras(const Pose& world_from_tool) const {
  const Vec3f tip = to_ras_mm(world_from_tool.position);
  const auto axis = [&](const Vec3f& along) {
    return to_ras_axes(rotate(world_from_tool.orientation, along));
  };
  const Vec3f x = axis({1, 0, 0}), y = axis({0, 1, 0}), z = axis({0, 0, 1});
  return {{{x.x, y.x, z.x, tip.x}, {x.y, y.y, z.y, tip.y}, {x.z, y.z, z.z, tip.z}}};
}

Result<Pose> Frames::from_ras(const Transform& m) const {
  for (const auto& row : m)
    for (const float number : row)
      if (!std::isfinite(number))
        return Error{ErrorCode::BadMessage, "matrix: has a number that is not finite"};
  std::array<Vec3f, 3> axis;
  for (std::size_t i = 0; i < 3; ++i) axis[i] = {m[0][i], m[1][i], m[2][i]};
  float skew = std::abs(dot(cross(axis[0], axis[1]), axis[2]) - 1);
  for (std::size_t i = 0; i < 3; ++i) {
    skew = std::max(skew, std::abs(length(axis[i]) - 1));
    skew = std::max(skew, std::abs(dot(axis[i], axis[(i + 1) % 3])));
  }
  // Numbers whose square overflows are no rotation either.
  if (!(skew <= kMostSkew))
    return refused(fmt::format(
        "matrix: is no rotation within {}: it scales, shears, mirrors or cannot be inverted",
        kMostSkew));
  const Vec3d ras{m[0][3], m[1][3], m[2][3]};
  const Vec3d place_mm = Vec3d{-ras.x, ras.z, ras.y} - offset_m_ * kMillimetres;
  if (length(place_mm) > double{kFarthest_mm})
    return refused(fmt::format("matrix: is {:.0f} mm from the organ's centre, allowed are {}",
                               length(place_mm), kFarthest_mm));
  const Vec3f x = axis[0] * (1 / length(axis[0]));
  const Vec3f y_like = axis[1] - x * dot(x, axis[1]);
  const Vec3f y = y_like * (1 / length(y_like));
  // The turn between the two frames is its own inverse.
  return Pose{to_float(place_mm / kMillimetres),
              quaternion_of({to_ras_axes(x), to_ras_axes(y), to_ras_axes(cross(x, y))})};
}

}  // namespace trocar::slicer
