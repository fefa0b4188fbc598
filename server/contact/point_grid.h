#pragma once

// Points in cubic cells, for "which are near here": a hash table of cells over a counting sort.
// build(): O(points + buckets), no allocation once it has had as many points. The order in which
// visit() names points follows from the positions alone.

#include <array>
#include <cstdint>
#include <vector>

#include "common/math/vec3.h"

namespace trocar::contact {

class PointGrid {
 public:
  PointGrid(float cell_m, std::size_t most_points) : per_m_(1 / cell_m) {
    std::size_t buckets = 16;
    while (buckets < 2 * most_points) buckets *= 2;
    begins_.resize(buckets + 1);
    points_.reserve(most_points);
    keys_.reserve(most_points);
  }

  // position(i) of entries 0 to count - 1.
  template <typename Position>
  void build(std::size_t count, Position&& position) {
    begins_.assign(begins_.size(), 0);
    keys_.resize(count);
    points_.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      keys_[i] = key_of(cell_of(position(i)));
      ++begins_[bucket_of(keys_[i]) + 1];
    }
    for (std::size_t b = 1; b < begins_.size(); ++b) begins_[b] += begins_[b - 1];
    for (std::size_t i = count; i-- > 0;)
      points_[--begins_[bucket_of(keys_[i]) + 1]] = {keys_[i], position(i),
                                                     static_cast<std::uint32_t>(i)};
    // begins_[b + 1] is now where bucket b begins.
  }
  // Entries in the cell of p and the 26 around it: all within a cell's width of p, and others.
  template <typename Visit>
  void visit(const Vec3f& p, Visit&& visit) const {
    const auto centre = cell_of(p);
    for (std::int32_t x = -1; x <= 1; ++x)
      for (std::int32_t y = -1; y <= 1; ++y)
        for (std::int32_t z = -1; z <= 1; ++z) {
          const auto key = key_of({centre[0] + x, centre[1] + y, centre[2] + z});
          const auto b = bucket_of(key);
          const auto end = b + 2 < begins_.size() ? begins_[b + 2] : points_.size();
          for (std::size_t i = begins_[b + 1]; i < end; ++i)
            if (points_[i].key == key) visit(points_[i].entry, points_[i].position);
        }
  }

 private:
  struct Point {
    std::uint64_t key = 0;
    Vec3f position;
    std::uint32_t entry = 0;
  };

  std::array<std::int32_t, 3> cell_of(const Vec3f& p) const {
    const auto cell = [this](float c) {
      constexpr float kMost = 1e6f;
      const float scaled = std::floor(c * per_m_);
      return static_cast<std::int32_t>(scaled < -kMost ? -kMost : scaled > kMost ? kMost : scaled);
    };
    return {cell(p.x), cell(p.y), cell(p.z)};
  }
  static std::uint64_t key_of(const std::array<std::int32_t, 3>& cell) {
    std::uint64_t key = 0;
    for (const auto c : cell) key = key << 21 | (static_cast<std::uint32_t>(c) & 0x1fffffu);
    return key;
  }
  std::size_t bucket_of(std::uint64_t key) const {
    key *= 0x9e3779b97f4a7c15u;
    return static_cast<std::size_t>(key >> 20) & (begins_.size() - 2);
  }

  float per_m_;
  std::vector<std::uint32_t> begins_;  // per bucket, one to the right
  std::vector<Point> points_;          // by bucket
  std::vector<std::uint64_t> keys_;
};

}  // namespace trocar::contact
