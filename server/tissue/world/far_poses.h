#pragma once

// Poses of the whole tissue from not long ago, about which a solver may take the tissue to be
// linear: one is taken every kInterval steps and two are kept, so that the solver can go over from
// the older to the newer bit by bit.
//
// They only have to be near the displacements, and are stored on a grid of 0.06 um. (On one of 61
// um its noise made forces of measured liver 3 % wrong; on one of 1 um the small tets along wounds
// trembled by 0.02 mm/s for ever.) A pose changes as a whole and rarely: the
// tick hash covers its hash. Where none was ever taken a snapshot holds none.

#include <array>
#include <span>
#include <vector>

#include "common/base/index.h"
#include "common/math/vec3.h"
#include "server/tissue/world/state_archive.h"

namespace trocar::world {

struct GridPoint {
  std::int32_t x = 0, y = 0, z = 0;
};
template <>
struct IsPaddingFree<GridPoint> : std::true_type {};

class FarPoses {
 public:
  static constexpr std::uint32_t kInterval = 64;

  explicit FarPoses(std::size_t node_count);

  // New nodes are where they would have been between a and b of those before, t/65536 of the way.
  void add_node(NodeIndex a, NodeIndex b, std::uint16_t t);

  // Before a step of the solver; true: a pose was taken.
  bool begin_step(std::span<const Vec3f> displacements);
  // Number of the newest pose, and steps begun since it was taken, less than kInterval.
  std::uint32_t newest() const { return newest_; }
  std::uint32_t age() const { return age_; }
  // The newest or the one before; the rest pose before there were any.
  std::span<const GridPoint> pose(std::uint32_t number) const { return poses_[number % 2]; }

  void visit_state(StateArchive& archive);

 private:
  void record(std::span<const Vec3f> displacements);
  // Hashes the nodes that there were when the pose was taken, then each that was added since.
  std::uint64_t hash_of(std::uint32_t number) const;

  std::uint32_t newest_ = 0, age_ = kInterval - 1;
  std::array<std::vector<GridPoint>, 2> poses_;
  std::array<std::uint64_t, 2> hashes_{};
  std::array<std::uint32_t, 2> taken_nodes_{};  // nodes when it was taken
};

// m
Vec3f displacement_of(const GridPoint& point);

}  // namespace trocar::world
