#include "server/organs/label_map/label_map.h"

#include <cmath>

namespace trocar::label_map {
namespace {

constexpr double kSkew = 1e-3;  // cosine between two steps from which on they are skewed
constexpr double kMinVoxel_m = 1e-6, kMaxVoxel_m = 0.1, kMaxOrigin_m = 1e6;

std::string orientation_of(const std::array<Vec3d, 3>& steps) {
  std::string text;
  for (const Vec3d& step : steps) {
    const double x = std::abs(step.x), y = std::abs(step.y), z = std::abs(step.z);
    text += x >= y && x >= z ? (step.x > 0 ? 'L' : 'R')
            : z >= y         ? (step.z > 0 ? 'A' : 'P')
                             : (step.y > 0 ? 'S' : 'I');
  }
  return text;
}

}  // namespace

std::string LabelCount::error() {
  return "has more than " + std::to_string(kMaxLabels) + " values: " + kGreyValues;
}

Status set_place(const Vec3d& origin_m, const std::array<Vec3d, 3>& steps_m, LabelMap& map) {
  const auto error = [](const std::string& text) { return Error{ErrorCode::BadFile, text}; };
  if (!is_finite(origin_m) || !(length(origin_m) < kMaxOrigin_m))
    return error("its origin is not finite");
  for (std::size_t c = 0; c < 3; ++c) {
    const double size = length(steps_m[c]);
    if (!(size >= kMinVoxel_m && size <= kMaxVoxel_m))
      return error("voxels are " + std::to_string(size * 1e3) + " mm along dimension " +
                   std::to_string(c + 1) + ", must be 0.001 to 100: check unit and spacing");
    for (std::size_t d = 0; d < c; ++d)
      if (std::abs(dot(steps_m[c], steps_m[d])) > kSkew * size * length(steps_m[d]))
        return error("its axes are skewed: resample it at right angles");
  }
  map.origin_m = origin_m;
  map.steps_m = steps_m;
  map.orientation = orientation_of(steps_m);
  return {};
}

}  // namespace trocar::label_map
