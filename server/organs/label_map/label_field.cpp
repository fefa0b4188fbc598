#include "server/organs/label_map/label_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace trocar::label_map {

LabelField::LabelField(const LabelSolid& solid) : map_(solid.map()), labels_(solid.map().labels) {
  const std::array<std::size_t, 3> size{std::size_t(map_.size[0]), std::size_t(map_.size[1]),
                                        std::size_t(map_.size[2])};
  const std::array<std::size_t, 3> stride{1, size[0], size[0] * size[1]};
  const auto for_each_neighbour = [&](std::uint32_t at, const auto& visit) {
    for (std::size_t d = 0; d < 3; ++d) {
      const auto place = at / stride[d] % size[d];
      if (place > 0) visit(at - static_cast<std::uint32_t>(stride[d]));
      if (place + 1 < size[d]) visit(at + static_cast<std::uint32_t>(stride[d]));
    }
  };
  // Layer by layer from the solid outward, within a layer in order of the voxels.
  std::vector<std::uint32_t> front, next;
  for (std::uint32_t at = 0; at < labels_.size(); ++at) {
    bool is_at_border = false;
    if (labels_[at] != 0)
      for_each_neighbour(at, [&](std::uint32_t to) { is_at_border |= labels_[to] == 0; });
    if (is_at_border) front.push_back(at);
  }
  while (!front.empty()) {
    next.clear();
    for (const auto at : front)
      for_each_neighbour(at, [&](std::uint32_t to) {
        if (labels_[to] != 0) return;
        labels_[to] = labels_[at];
        next.push_back(to);
      });
    std::swap(front, next);
  }
}

std::uint16_t LabelField::operator()(const Vec3d& p) const {
  const Vec3d v = map_.voxel_of(p);
  const std::array<double, 3> at{v.x, v.y, v.z};
  std::array<std::array<double, 3>, 3> weights;
  std::array<std::array<int, 3>, 3> voxels;
  for (std::size_t d = 0; d < 3; ++d) {
    const double inside = std::clamp(at[d], 0.0, map_.size[d] - 1.0);
    const double nearest = std::round(inside), off = inside - nearest;
    weights[d] = {(0.5 - off) * (0.5 - off) / 2, 0.75 - off * off, (0.5 + off) * (0.5 + off) / 2};
    for (int step = 0; step < 3; ++step)
      voxels[d][static_cast<std::size_t>(step)] =
          std::clamp(static_cast<int>(nearest) + step - 1, 0, map_.size[d] - 1);
  }
  std::array<std::pair<std::uint16_t, double>, 27> shares;
  std::size_t count = 0;
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t j = 0; j < 3; ++j) {
      const double weight = weights[2][k] * weights[1][j];
      for (std::size_t i = 0; i < 3; ++i) {
        const auto label = labels_[map_.index(voxels[0][i], voxels[1][j], voxels[2][k])];
        std::size_t s = 0;
        while (s < count && shares[s].first != label) ++s;
        if (s == count) shares[count++] = {label, 0};
        shares[s].second += weight * weights[0][i];
      }
    }
  std::size_t best = 0;
  for (std::size_t s = 1; s < count; ++s)
    if (shares[s].second > shares[best].second ||
        (shares[s].second == shares[best].second && shares[s].first < shares[best].first))
      best = s;
  return shares[best].first;
}

}  // namespace trocar::label_map
