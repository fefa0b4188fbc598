#pragma once

// A volume image whose numbers say to which structure each voxel belongs.

#include <array>
#include <bitset>
#include <cstddef>
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

// A volume with more values than this, beside 0, is a scan of grey values, and no label map.
inline constexpr std::size_t kMaxLabels = 256;
inline constexpr const char* kGreyValues =
    "it holds grey values, not labels, so segment it first, in 3D Slicer for instance";

// Tells label maps from scans by the number of values.
class LabelCount {
 public:
  // False: there are more than kMaxLabels.
  bool add(std::uint16_t label) {
    if (label == 0 || seen_[label]) return true;
    seen_[label] = true;
    return ++count_ <= kMaxLabels;
  }
  // The error after that, without the file's name.
  static std::string error();

 private:
  std::bitset<65536> seen_;
  std::size_t count_ = 0;
};

// Sets origin, steps and orientation. Error, without the file's name: a value is not finite, a step
// is not 0.001 to 100 mm long, or the steps are not at right angles.
Status set_place(const Vec3d& origin_m, const std::array<Vec3d, 3>& steps_m, LabelMap& map);

}  // namespace trocar::label_map
