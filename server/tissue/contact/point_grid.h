#pragma once

// Points in cubic cells, for "which are within a range of here": a counting sort over the points'
// bounding box, in rows along z, so that a look around reads nine runs of memory. The box has at
// most kMostCells^3 cells; what lies beyond counts to the cells at its rim, so that it is found as
// well, only with more looking.
//
// build(): O(points + cells), no allocation once it has had as many points. visit(): O(points in
// the 27 cells around).

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "common/math/vec3.h"

namespace trocar::contact {

class PointGrid {
 public:
  PointGrid(float cell_m, std::size_t most_points) : cell_m_(cell_m), per_m_(1 / cell_m) {
    begins_.reserve(std::size_t{kMostCells} * kMostCells * kMostCells + 1);
    for (auto& coordinates : positions_) coordinates.reserve(most_points + kAtOnce);
    entries_.reserve(most_points);
    cells_.reserve(most_points);
  }

  // position(i) of entries 0 to count - 1.
  template <typename Position>
  void build(std::size_t count, Position&& position) {
    lay_cells(count, position);
    begins_.assign(std::size_t{counts_[0]} * counts_[1] * counts_[2] + 1, 0);
    cells_.resize(count);
    entries_.resize(count);
    for (auto& coordinates : positions_) coordinates.resize(count + kAtOnce);
    for (std::size_t i = 0; i < count; ++i) {
      const auto at = cell_of(position(i));
      cells_[i] = (at[0] * counts_[1] + at[1]) * counts_[2] + at[2];
      ++begins_[cells_[i]];
    }
    for (std::size_t c = 1; c < begins_.size(); ++c) begins_[c] += begins_[c - 1];
    for (std::size_t i = count; i-- > 0;) {
      const auto at = --begins_[cells_[i]];
      const Vec3f p = position(i);
      positions_[0][at] = p.x, positions_[1][at] = p.y, positions_[2][at] = p.z;
      entries_[at] = static_cast<std::uint32_t>(i);
    }
  }
  // All entries, those of a cell together.
  std::span<const std::uint32_t> entries() const { return entries_; }
  // visit(entry, squared distance) of all within range_m of p; range_m at most a cell's width.
  template <typename Visit>
  void visit(const Vec3f& p, float range_m, Visit&& visit) const {
    const auto at = cell_of(p);
    const auto before = [](std::uint32_t cell) { return cell > 0 ? cell - 1 : 0; };
    const auto after = [&](std::size_t axis) { return std::min(at[axis] + 1, counts_[axis] - 1); };
    for (auto x = before(at[0]); x <= after(0); ++x)
      for (auto y = before(at[1]); y <= after(1); ++y) {
        const auto row = (x * counts_[1] + y) * counts_[2];
        visit_run(begins_[row + before(at[2])], begins_[row + after(2) + 1], p, range_m * range_m,
                  visit);
      }
  }

 private:
  static constexpr std::uint32_t kMostCells = 32;  // per axis
  // A fixed number, so that the compiler takes them in one vector; the arrays are so much longer.
  static constexpr std::uint32_t kAtOnce = 8;

  template <typename Position>
  void lay_cells(std::size_t count, Position&& position) {
    Vec3f least{1e30f, 1e30f, 1e30f}, most = -least;
    for (std::size_t i = 0; i < count; ++i) {
      const Vec3f p = position(i);
      least = {std::min(least.x, p.x), std::min(least.y, p.y), std::min(least.z, p.z)};
      most = {std::max(most.x, p.x), std::max(most.y, p.y), std::max(most.z, p.z)};
    }
    const auto lay = [this](float from, float to, std::uint32_t& cells, float& origin) {
      const float width = std::ceil((to - from) * per_m_);
      cells = width > 1
                  ? static_cast<std::uint32_t>(std::min(width, static_cast<float>(kMostCells)))
                  : 1;
      origin = 0.5f * (from + to) - 0.5f * static_cast<float>(cells) * cell_m_;
    };
    lay(least.x, most.x, counts_[0], origin_.x);
    lay(least.y, most.y, counts_[1], origin_.y);
    lay(least.z, most.z, counts_[2], origin_.z);
  }
  std::array<std::uint32_t, 3> cell_of(const Vec3f& p) const {
    const auto cell = [this](float offset_m, std::uint32_t cells) {
      const float scaled = offset_m * per_m_;
      return scaled > 0
                 ? static_cast<std::uint32_t>(std::min(scaled, static_cast<float>(cells - 1)))
                 : 0u;
    };
    const Vec3f offset = p - origin_;
    return {cell(offset.x, counts_[0]), cell(offset.y, counts_[1]), cell(offset.z, counts_[2])};
  }
  template <typename Visit>
  void visit_run(std::uint32_t begin, std::uint32_t end, const Vec3f& p, float most_squared,
                 Visit&& visit) const {
    std::array<float, kAtOnce> squared;
    for (auto first = begin; first < end; first += kAtOnce) {
      const float *x = &positions_[0][first], *y = &positions_[1][first],
                  *z = &positions_[2][first];
      for (std::uint32_t i = 0; i < kAtOnce; ++i)
        squared[i] = length_squared(Vec3f{x[i] - p.x, y[i] - p.y, z[i] - p.z});
      for (std::uint32_t i = 0; i < std::min(kAtOnce, end - first); ++i)
        if (squared[i] <= most_squared) visit(entries_[first + i], squared[i]);
    }
  }

  float cell_m_, per_m_;
  Vec3f origin_;
  std::array<std::uint32_t, 3> counts_{1, 1, 1};  // cells per axis
  std::vector<std::uint32_t> begins_;             // per cell, and the end
  std::array<std::vector<float>, 3> positions_;   // by cell
  std::vector<std::uint32_t> entries_, cells_;    // by cell; per entry
};

}  // namespace trocar::contact
