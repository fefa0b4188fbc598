#pragma once

// A volume image whose numbers say to which structure each voxel belongs.

#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/math/vec3.h"

namespace trocar::label_map {

struct LabelMap {
  std::array<int, 3> size{};          // voxels along i, j, k
  std::vector<std::uint16_t> labels;  // i fastest, then j; 0: none
  // Centre of voxel (0, 0, 0) and the steps to its neighbours, m: x to the patient's left, y to the
  // head, z to the front. The steps are at right angles to one another.
  Vec3d origin_m;
  std::array<Vec3d, 3> steps_m{};
  double unit_m = 1e-3;     // in which the file gives them
  std::string orientation;  // towards which sides i, j and k run, such as "RAS" or "LPS"
  std::vector<std::pair<std::uint16_t, std::string>> names;  // that the file gives to labels
  std::vector<std::string> warnings;

  std::size_t index(int i, int j, int k) const {
    return static_cast<std::size_t>(i) +
           static_cast<std::size_t>(size[0]) *
               (static_cast<std::size_t>(j) +
                static_cast<std::size_t>(size[1]) * static_cast<std::size_t>(k));
  }
  // The place p, m, counted in voxels from the centre of the first.
  Vec3d voxel_of(const Vec3d& p) const {
    const Vec3d d = p - origin_m;
    const auto along = [&d](const Vec3d& step) { return dot(d, step) / length_squared(step); };
    return {along(steps_m[0]), along(steps_m[1]), along(steps_m[2])};
  }
  double voxel_volume_m3() const {
    return length(steps_m[0]) * length(steps_m[1]) * length(steps_m[2]);
  }
};

// Sets origin, steps and orientation. Error, without the file's name: a value is not finite, a step
// is not 0.001 to 100 mm long, or the steps are not at right angles.
Status set_place(const Vec3d& origin_m, const std::array<Vec3d, 3>& steps_m, LabelMap& map);

}  // namespace trocar::label_map
