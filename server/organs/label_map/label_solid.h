#pragma once

// The solid of a label map: which voxels belong to it, and how far a point is from its surface.
//
// The distance is that between voxel centres (exact, axis by axis), half a voxel less, smoothed
// once by 1-2-1 along each axis and interpolated linearly: the steps of the voxels are rounded off.
// It is right near the surface only.
//
// Source: Felzenszwalb, Huttenlocher: Distance transforms of sampled functions, Theory of Computing
// 8, 2012.

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/organs/label_map/label_map.h"
#include "server/organs/mesh/stuffing.h"

namespace trocar::label_map {

inline constexpr double kVoxelsOverSurface = 1.5;  // area of a voxel surface over the true one

class LabelSolid {
 public:
  // labels: which belong to it; none: all but 0. Error: no voxel has one of them, or they are
  // several bodies of which the largest has less than 90 % of the volume (smaller ones are dropped
  // with a warning), or it is one voxel thick nearly all over and has no inside. `name` starts each
  // error.
  static Result<LabelSolid> make(LabelMap map, const std::vector<std::uint16_t>& labels,
                                 const std::string& name);

  double distance(const Vec3d& p) const;  // m, negative inside, in the map's frame
  // Returns the label of the nearest voxel, 0 beside the solid.
  std::uint16_t label_at(const Vec3d& p) const;
  mesh::Box box() const;  // around the solid

  double volume_m3() const { return volume_m3_; }
  double surface_m2() const { return surface_m2_; }  // of the voxels, kVoxelsOverSurface of it
  // Labels that the solid has, ascending, and the volume of each.
  const std::vector<std::uint16_t>& labels() const { return labels_; }
  double volume_of(std::uint16_t label) const;
  const std::vector<std::string>& warnings() const { return map_.warnings; }
  const LabelMap& map() const { return map_; }

 private:
  explicit LabelSolid(LabelMap map) : map_(std::move(map)) {}

  Status crop(const std::vector<std::uint16_t>& labels, const std::string& name);
  Status keep_largest_body(const std::string& name);
  void measure();
  void find_distances();
  std::string thinness() const;  // of a solid that has no inside

  LabelMap map_;                   // cut to the solid and a margin; what does not belong to it is 0
  std::vector<float> distance_m_;  // one a voxel
  std::vector<std::uint16_t> labels_;
  std::vector<double> label_volumes_m3_;
  double volume_m3_ = 0, surface_m2_ = 0;
};

}  // namespace trocar::label_map
