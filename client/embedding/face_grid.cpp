#include "client/embedding/face_grid.h"

#include <algorithm>
#include <cmath>

#include "common/math/nearest_point.h"

namespace trocar::embedding {
namespace {

constexpr int kMostCells = 48;                 // along a side
constexpr float kMostReachCells = 2;           // farther away nothing is looked for
constexpr std::uint64_t kMostCellsEach = 32;   // of a triangle, on average
constexpr std::size_t kMostForNearest = 4096;  // triangles, for the nearest one

bool has_area(const TriangleCorners& t) {
  return t[0] != t[1];
}

}  // namespace

FacePlace nearest_on(const Vec3f& p, const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  const Vec3f w = nearest_weights(p, a, b, c);
  return {
      .face = 0, .weight = {w.x, w.y, w.z}, .distance_m = length(a * w.x + b * w.y + c * w.z - p)};
}

std::array<int, 3> FaceGrid::cell_of(const Vec3f& p) const {
  const auto along = [this](float x, int size) {
    return static_cast<int>(std::clamp(x / cell_m_, 0.0f, static_cast<float>(size - 1)));
  };
  const Vec3f from = p - origin_;
  return {along(from.x, size_[0]), along(from.y, size_[1]), along(from.z, size_[2])};
}

template <typename Visit>
void FaceGrid::for_cells(const Box<float>& box, const Visit& visit) const {
  const auto low = cell_of(box.least), high = cell_of(box.most);
  for (int z = low[2]; z <= high[2]; ++z)
    for (int y = low[1]; y <= high[1]; ++y)
      for (int x = low[0]; x <= high[0]; ++x)
        if (!visit(static_cast<std::size_t>((z * size_[1] + y) * size_[0] + x))) return;
}

Box<float> FaceGrid::box_of(std::size_t triangle) const {
  Box<float> box;
  for (const std::uint32_t v : triangles_[triangle]) box.include(positions_[v]);
  return box;
}

std::size_t FaceGrid::choose_cells(float cell_m) {
  const bool is_empty = all_.least.x > all_.most.x;
  const Vec3f extent = is_empty ? Vec3f{} : all_.most - all_.least;
  origin_ = is_empty ? Vec3f{} : all_.least;
  cell_m_ = std::max({cell_m, std::max({extent.x, extent.y, extent.z}) / kMostCells, 1e-6f});
  for (;; cell_m_ *= 2) {
    size_ = {static_cast<int>(extent.x / cell_m_) + 1, static_cast<int>(extent.y / cell_m_) + 1,
             static_cast<int>(extent.z / cell_m_) + 1};
    const auto cells = static_cast<std::size_t>(size_[0] * size_[1] * size_[2]);
    std::uint64_t met = 0;
    for (std::size_t i = 0; i < triangles_.size() && cells > 1; ++i) {
      if (!has_area(triangles_[i])) continue;
      const Box<float> box = box_of(i);
      const auto low = cell_of(box.least), high = cell_of(box.most);
      std::uint64_t each = 1;
      for (std::size_t axis = 0; axis < 3; ++axis)
        each *= static_cast<std::uint64_t>(high[axis] - low[axis] + 1);
      met += each;
    }
    if (met <= kMostCellsEach * triangles_.size() + cells) return cells;
  }
}

void FaceGrid::build(std::span<const Vec3f> positions, std::span<const TriangleCorners> triangles,
                     float cell_m) {
  positions_ = positions;
  triangles_ = triangles;
  all_ = {};
  for (const TriangleCorners& t : triangles)
    if (has_area(t))
      for (const std::uint32_t v : t) all_.include(positions[v]);
  const std::size_t cells = choose_cells(cell_m);
  first_.assign(cells + 1, 0);
  for (std::size_t i = 0; i < triangles.size(); ++i)
    if (has_area(triangles[i]))
      for_cells(box_of(i), [this](std::size_t cell) {
        ++first_[cell + 1];
        return true;
      });
  for (std::size_t cell = 0; cell < cells; ++cell) first_[cell + 1] += first_[cell];
  entries_.resize(first_[cells]);
  for (std::size_t i = 0; i < triangles.size(); ++i)
    if (has_area(triangles[i]))
      for_cells(box_of(i), [&](std::size_t cell) {
        entries_[first_[cell]++] = static_cast<std::uint32_t>(i);
        return true;
      });
  // Each cell's first is now that of the next one.
  for (std::size_t cell = cells; cell > 0; --cell) first_[cell] = first_[cell - 1];
  first_[0] = 0;
  seen_.assign(triangles.size(), 0);
  query_ = 0;
}

void FaceGrid::find(const Box<float>& box, std::vector<std::uint32_t>& found,
                    std::size_t most) const {
  if (!all_.overlaps(box)) return;
  ++query_;
  std::size_t looked_at = 0;
  for_cells(box, [&](std::size_t cell) {
    ++looked_at;
    for (std::uint32_t i = first_[cell]; i < first_[cell + 1] && looked_at < most; ++i) {
      ++looked_at;
      const std::uint32_t face = entries_[i];
      if (seen_[face] == query_) continue;
      seen_[face] = query_;
      if (box_of(face).overlaps(box)) found.push_back(face);
    }
    return looked_at < most;
  });
}

FacePlace FaceGrid::nearest(const Vec3f& p, const Vec3f& normal) const {
  FacePlace best, any;
  if (entries_.empty()) return best;
  std::size_t looked_at = 0;
  for (float reach = 0.25f * cell_m_;; reach *= 2) {
    Box<float> box;
    box.include(p);
    box.grow(reach);
    ++query_;
    const auto consider = [](FacePlace& kept, const FacePlace& place) {
      const bool is_nearer = place.distance_m < kept.distance_m ||
                             (place.distance_m == kept.distance_m && place.face < kept.face);
      if (kept.face == kNoFace || is_nearer) kept = place;
    };
    for_cells(box, [&](std::size_t cell) {
      for (std::uint32_t i = first_[cell]; i < first_[cell + 1] && looked_at < kMostForNearest;
           ++i) {
        ++looked_at;
        const std::uint32_t face = entries_[i];
        if (seen_[face] == query_) continue;
        seen_[face] = query_;
        const auto& [a, b, c] = triangles_[face];
        FacePlace place = nearest_on(p, positions_[a], positions_[b], positions_[c]);
        place.face = face;
        consider(any, place);
        const Vec3f n = cross(positions_[b] - positions_[a], positions_[c] - positions_[a]);
        if (dot(n, normal) > 0) consider(best, place);
      }
      return looked_at < kMostForNearest;
    });
    if (best.face != kNoFace && best.distance_m <= reach) return best;
    if (reach <= kMostReachCells * cell_m_ && looked_at < kMostForNearest) continue;
    if (best.face == kNoFace) best = any;
    return best.distance_m <= 2 * reach ? best : FacePlace{};
  }
}

}  // namespace trocar::embedding
