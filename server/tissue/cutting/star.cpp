#include "server/tissue/cutting/star.h"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "common/base/assert.h"

namespace trocar::cutting {

void CutFaces::flip(const TetFace& face) {
  const auto other = across(topology_, face);
  TROCAR_ASSERT(other.has_value());
  masks_.resize(std::max(masks_.size(), topology_.tet_count()));
  for (const auto& side : {face, *other}) {
    auto& mask = masks_[side.tet.value];
    if (mask == 0) masked_.push_back(side.tet);
    mask = static_cast<std::uint8_t>(mask ^ (1 << side.corner));
  }
}
void CutFaces::cut(const TetFace& face) {
  TROCAR_ASSERT(!is_cut(face));
  flip(face);
}
void CutFaces::mend(const TetFace& face) {
  TROCAR_ASSERT(is_cut(face));
  flip(face);
}
void CutFaces::clear() {
  for (const auto tet : masked_) masks_[tet.value] = 0;
  masked_.clear();
}

std::uint16_t Star::component_of(TetIndex tet) const {
  const auto at = std::lower_bound(tets.begin(), tets.end(), tet);
  TROCAR_ASSERT_HOT(at != tets.end() && *at == tet);
  return components[static_cast<std::size_t>(at - tets.begin())];
}

std::uint32_t StarAnalysis::find(std::vector<std::uint32_t>& parents, std::uint32_t item) {
  while (parents[item] != item) item = parents[item] = parents[parents[item]];
  return item;
}
// The lower one becomes the root, whatever the order.
void StarAnalysis::join(std::vector<std::uint32_t>& parents, std::uint32_t a, std::uint32_t b) {
  a = find(parents, a);
  b = find(parents, b);
  parents[std::max(a, b)] = std::min(a, b);
}

void StarAnalysis::join_over_faces(const topology::Topology& topology, const CutFaces& cuts,
                                   const Star& star) {
  const auto count = static_cast<std::uint32_t>(star.tets.size());
  sides_.clear();
  free_sides_.assign(count, 0);
  tet_parents_.resize(count);
  corner_parents_.resize(4 * count);
  std::iota(tet_parents_.begin(), tet_parents_.end(), 0u);
  std::iota(corner_parents_.begin(), corner_parents_.end(), 0u);
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto& tet = topology.tet(star.tets[i]);
    const auto own = corner_of(tet, star.node);
    for (std::uint8_t corner = 0; corner < 4; ++corner) {
      if (corner == own) continue;
      std::uint32_t low = 0xffffffffu, high = 0;
      for (std::uint8_t k = 0; k < 4; ++k) {
        if (k == own || k == corner) continue;
        low = std::min(low, tet[k].value);
        high = std::max(high, tet[k].value);
      }
      sides_.push_back({std::uint64_t{low} << 32 | high, i, corner});
    }
  }
  std::sort(sides_.begin(), sides_.end());
  for (std::size_t s = 0; s < sides_.size(); ++s) {
    const auto& side = sides_[s];
    const bool has_other = s + 1 < sides_.size() && sides_[s + 1].key == side.key;
    if (!has_other || cuts.is_cut({star.tets[side.tet], side.corner})) {
      ++free_sides_[side.tet];
      if (has_other) ++free_sides_[sides_[s + 1].tet];
    } else {
      const auto& other = sides_[s + 1];
      join(tet_parents_, side.tet, other.tet);
      const auto &tet = topology.tet(star.tets[side.tet]),
                 &other_tet = topology.tet(star.tets[other.tet]);
      for (const auto node : {NodeIndex(static_cast<std::uint32_t>(side.key >> 32)),
                              NodeIndex(static_cast<std::uint32_t>(side.key))})
        join(corner_parents_, 4 * side.tet + corner_of(tet, node),
             4 * other.tet + corner_of(other_tet, node));
    }
    if (has_other) ++s;
  }
}

void StarAnalysis::number_components(Star& out) {
  const auto count = static_cast<std::uint32_t>(out.tets.size());
  out.components.resize(count);
  out.component_count = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto root = find(tet_parents_, i);
    out.components[i] = root == i ? out.component_count++ : out.components[root];
  }
}

void StarAnalysis::find_fans(const topology::Topology& topology, Star& out) {
  corners_.clear();
  for (std::uint32_t i = 0; i < out.tets.size(); ++i) {
    const auto& tet = topology.tet(out.tets[i]);
    for (std::uint8_t k = 0; k < 4; ++k)
      if (tet[k] != out.node && find(corner_parents_, 4 * i + k) == 4 * i + k)
        corners_.push_back({tet[k], 4 * i + k, i});
  }
  std::sort(corners_.begin(), corners_.end(), [&](const LinkCorner& a, const LinkCorner& b) {
    return std::tuple(a.other, out.components[a.tet], a.root) <
           std::tuple(b.other, out.components[b.tet], b.root);
  });
  out.twin_fans.clear();
  const auto are_twins = [&](std::size_t i, std::size_t j) {
    return j < corners_.size() && corners_[i].other == corners_[j].other &&
           out.components[corners_[i].tet] == out.components[corners_[j].tet];
  };
  for (std::size_t i = 0; i < corners_.size(); ++i)
    if (are_twins(i, i + 1) || (i > 0 && are_twins(i - 1, i)))
      out.twin_fans.push_back(
          {corners_[i].other, out.tets[corners_[i].tet], out.components[corners_[i].tet]});
}

void StarAnalysis::judge(Star& out) {
  chi_.assign(out.component_count, 0);
  boundary_.assign(out.component_count, 0);
  for (const auto& corner : corners_) ++chi_[out.components[corner.tet]];
  // faces = (3 tets + free sides) / 2: add twice (tets - faces), halve at the end.
  for (auto& chi : chi_) chi *= 2;
  for (std::size_t i = 0; i < out.tets.size(); ++i) {
    const auto free = static_cast<std::int32_t>(free_sides_[i]);
    chi_[out.components[i]] += 2 - 3 - free;
    boundary_[out.components[i]] += free;
  }
  out.bad_components.clear();
  for (std::uint16_t c = 0; c < out.component_count; ++c)
    if (chi_[c] != (boundary_[c] > 0 ? 2 : 4)) out.bad_components.push_back(c);
}

void StarAnalysis::run(const topology::Topology& topology, const CutFaces& cuts, NodeIndex node,
                       Star& out) {
  out.node = node;
  const auto tets = topology.tets_of(node);
  out.tets.assign(tets.begin(), tets.end());
  join_over_faces(topology, cuts, out);
  number_components(out);
  find_fans(topology, out);
  judge(out);
}

}  // namespace trocar::cutting
