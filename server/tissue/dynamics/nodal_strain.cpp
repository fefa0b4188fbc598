#include "server/tissue/dynamics/nodal_strain.h"

#include <algorithm>

#include "server/organs/organ/any_material.h"
#include "server/tissue/topology/tet_shape.h"

namespace trocar::dynamics {
namespace {

bool is_averaged(const material::Material& material) {
  return material::is_hyperelastic(material) && material.has_averaged_strain;
}

}  // namespace

bool NodalStrain::are_needed(const organ::Organ& organ) {
  return organ::any_material(organ, is_averaged);
}

NodalStrain::NodalStrain(const topology::Topology& topology, const Groups& groups)
    : parameters_(hyperelastic_parameters(topology.organ(), is_averaged)),
      materials_(topology.node_count(), kNone) {
  for (std::uint32_t n = 0; n < materials_.size(); ++n) find_material(topology, NodeIndex(n));
  const auto bound = [&](NodeIndex node) {
    find_pairs(topology, node, pairs_[0]);
    return pairs_[0].size();
  };
  rows_.reserve(groups, bound);
  members_.reserve(groups, bound);
  extend(groups);
  for (Group g = 0; g < groups.group_count(); ++g) fill(topology, groups, {g, 0xff});
  rows_.end_building();
  members_.end_building();
}

void NodalStrain::update(const topology::Topology& topology, std::span<const NodeIndex> changed) {
  materials_.resize(topology.node_count(), kNone);
  for (const auto node : changed) find_material(topology, node);
}

void NodalStrain::extend(const Groups& groups) {
  rows_.extend(groups);
  members_.extend(groups);
  at_rest_.resize(groups.slot_count());
  gradients_.resize(3 * groups.slot_count());
}

std::size_t NodalStrain::rebuild(const topology::Topology& topology, const Groups& groups,
                                 std::span<const GroupLanes> lanes) {
  extend(groups);
  std::size_t written = 0;
  for (const auto group_lanes : lanes) written += fill(topology, groups, group_lanes);
  rows_.tidy();
  members_.tidy();
  return written;
}

void NodalStrain::find_material(const topology::Topology& topology, NodeIndex node) {
  auto& best = materials_[node.value];
  best = kNone;
  if (!topology.has_node(node)) return;
  const auto volume_of = [&](std::uint16_t material) {
    double volume = 0;
    for (const auto t : topology.tets_of(node))
      if (topology.material_of(t) == material)
        volume += topology::tet_shape(topology.rest(), topology.tet(t)).volume;
    return volume;
  };
  double largest = 0;
  for (const auto t : topology.tets_of(node)) {
    const auto material = topology.material_of(t);
    if (material == best || !parameters_[material]) continue;
    if (best == kNone) {
      best = material;
      continue;
    }
    if (largest == 0) largest = volume_of(best);
    const double volume = volume_of(material);
    if (volume < largest || (volume == largest && material > best)) continue;
    best = material;
    largest = volume;
  }
}

NodalStrain::Left NodalStrain::left_to(const topology::Topology& topology, TetIndex tet) const {
  const auto corners =
      std::ranges::count_if(topology.tet(tet), [&](NodeIndex n) { return has(topology, n, tet); });
  const double share = static_cast<double>(corners) / 4;
  return {1 - kAveragedBracket * share, 1 - share};
}

NodalStrain::Domain NodalStrain::domain_at_rest(const topology::Topology& topology,
                                                NodeIndex node) const {
  if (!node.is_valid() || material_of(node) == kNone) return {};
  std::array<Vec3d, 3> rows{};
  double volume = 0;
  for (const auto t : topology.tets_of(node)) {
    if (!has(topology, node, t)) continue;
    const auto& tet = topology.tet(t);
    const auto shape = topology::stress_free_shape(topology, t, tet);
    const double share = shape.volume / 4;
    volume += share;
    const auto& first = topology.rest()[tet[0].value];
    for (std::size_t k = 1; k < 4; ++k) {
      const Vec3d edge = topology.rest()[tet[k].value] - first, part = shape.gradients[k] * share;
      rows[0] += part * edge.x, rows[1] += part * edge.y, rows[2] += part * edge.z;
    }
    rows[0].x -= share, rows[1].y -= share, rows[2].z -= share;
  }
  const auto [c10, bulk] = *parameters_[material_of(node)];
  Domain domain;
  for (std::size_t r = 0; r < 3; ++r) domain[r] = to_float4(to_float(rows[r]));
  domain[0].w = static_cast<float>(1 / volume);
  domain[1].w = static_cast<float>(2 * c10 * kAveragedBracket);
  domain[2].w = static_cast<float>(bulk);
  return domain;
}

void NodalStrain::find_pairs(const topology::Topology& topology, NodeIndex node,
                             std::vector<Pair>& out) const {
  out.clear();
  for (const auto t : topology.tets_of(node)) {
    if (!parameters_[topology.material_of(t)]) continue;
    const auto& tet = topology.tet(t);
    const auto shape = topology::stress_free_shape(topology, t, tet);
    const auto own = static_cast<std::size_t>(std::ranges::find(tet, node) - tet.begin());
    const bool is_in_own = has(topology, node, t);
    for (std::size_t k = 0; k < 4; ++k) {
      const bool is_in_others = has(topology, tet[k], t);
      if (!is_in_others && !is_in_own) continue;
      auto found = std::ranges::find(out, tet[k], &Pair::other);
      if (found == out.end()) found = out.insert(out.end(), Pair{tet[k], {}, {}});
      if (is_in_others) found->part += shape.gradients[own] * (shape.volume / 4);
      if (is_in_own) found->others_part += shape.gradients[k] * (shape.volume / 4);
    }
  }
}

std::size_t NodalStrain::fill(const topology::Topology& topology, const Groups& groups,
                              GroupLanes lanes) {
  const auto nodes = groups.nodes_of(lanes.group);
  std::array<std::uint32_t, kLanes> counts{};
  std::size_t written = 0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    if (!lanes.has(lane)) continue;
    const auto slot = lanes.group * kLanes + lane;
    at_rest_[slot] = domain_at_rest(topology, nodes[lane]);
    std::ranges::copy(at_rest_[slot], &gradients_[3 * slot]);
    pairs_[lane].clear();
    if (nodes[lane].is_valid()) find_pairs(topology, nodes[lane], pairs_[lane]);
    counts[lane] = static_cast<std::uint32_t>(pairs_[lane].size());
    written += counts[lane];
  }
  const auto rows = rows_.reshape(lanes, counts);
  const auto members = members_.reshape(lanes, counts);
  for (std::size_t lane = 0; lane < kLanes; ++lane)
    for (std::size_t i = 0; lanes.has(lane) && i < pairs_[lane].size(); ++i) {
      const auto& [other, part, others_part] = pairs_[lane][i];
      rows[i].domain.v[lane] = 3 * groups.slot_of(other);
      rows[i].part.set(lane, to_float(part));
      members[i].node.v[lane] = groups.slot_of(other);
      members[i].part.set(lane, to_float(others_part));
    }
  return written;
}

void NodalStrain::restart_group(Group group, const Float4* x) {
  restarted(group, x);
}

// Eight lanes, one after another: nodes of a group share no smoothing domain.
void NodalStrain::after_move(Group group, const Vec8& dx, std::uint8_t lanes) {
  Vec3Lanes moves;
  store(moves, dx);
  std::array<std::uint8_t, kLanes> moving{};
  std::size_t count = 0;
  for (std::uint8_t lane = 0; lane < kLanes; ++lane)
    if (lanes >> lane & 1) moving[count++] = lane;
  for (const Row& row : rows_[group]) {
    const auto& part = row.part;
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t lane = moving[i];
      const __m128 b = _mm_setr_ps(part.x.v[lane], part.y.v[lane], part.z.v[lane], 0);
      Float4* const domain = &gradients_[row.domain.v[lane]];
      const auto push = [b](Float4& h, float move) {
        _mm_store_ps(&h.x, _mm_fmadd_ps(_mm_set1_ps(move), b, _mm_load_ps(&h.x)));
      };
      push(domain[0], moves.x.v[lane]), push(domain[1], moves.y.v[lane]);
      push(domain[2], moves.z.v[lane]);
    }
  }
}

}  // namespace trocar::dynamics
