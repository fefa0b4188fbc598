#include "server/dynamics/relaxed_stress.h"

#include <algorithm>

namespace trocar::dynamics {
namespace {

Float8 loads_at(const float* loads, const SlotLanes& places) {
  return _mm256_i32gather_ps(loads, _mm256_load_si256(reinterpret_cast<const __m256i*>(places.v)),
                             sizeof(float));
}

}  // namespace

RelaxedStress::RelaxedStress(const Topology& topology, const Groups& groups,
                             const Relaxation& relaxation)
    : relaxation_(relaxation) {
  rows_.reserve(groups, [&](NodeIndex node) { return topology.tets_of(node).size(); });
  for (Group g = 0; g < groups.group_count(); ++g) fill(topology, groups, {g, 0xff});
  rows_.end_building();
}

std::size_t RelaxedStress::rebuild(const Topology& topology, const Groups& groups,
                                   std::span<const GroupLanes> lanes) {
  rows_.extend(groups);
  std::size_t written = 0;
  for (const auto group_lanes : lanes) written += fill(topology, groups, group_lanes);
  rows_.tidy();
  return written;
}

std::size_t RelaxedStress::fill(const Topology& topology, const Groups& groups, GroupLanes lanes) {
  const auto nodes = groups.nodes_of(lanes.group);
  std::array<std::uint32_t, kLanes> counts{};
  std::size_t written = 0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    tets_[lane].clear();
    if (!lanes.has(lane) || !nodes[lane].is_valid()) continue;
    for (const auto t : topology.tets_of(nodes[lane]))
      if (relaxes(scene::material_at(topology.organ(), topology.material_of(t))))
        tets_[lane].push_back(t);
    counts[lane] = static_cast<std::uint32_t>(tets_[lane].size());
    written += counts[lane];
  }
  const auto rows = rows_.reshape(lanes, counts);
  const auto rest = topology.rest();
  for (std::size_t lane = 0; lane < kLanes; ++lane)
    for (std::size_t i = 0; i < tets_[lane].size(); ++i) {
      const auto t = tets_[lane][i];
      const auto& tet = topology.tet(t);
      const auto own = static_cast<std::size_t>(std::ranges::find(tet, nodes[lane]) - tet.begin());
      for (std::size_t k = 0; k < 3; ++k) {
        const auto other = (own + 1 + k) % 4;
        rows[i].others[k].v[lane] = groups.slot_of(tet[other]);
        rows[i].loads[k].v[lane] = Relaxation::load_index(t, own, other);
        rows[i].edges[k].set(lane, to_float(rest[tet[other].value] - rest[tet[own].value]));
      }
    }
  return written;
}

// Along an edge a stress pulls its ends together; what has been forgotten of it lets them go.
Vec8 RelaxedStress::forces(Group group, const Float4* x) const {
  const float* const loads = relaxation_.loads();
  const Vec8 own = load_group(x + group * kLanes);
  Vec8 sum = zero_vec8();
  for (const Row& row : rows_[group])
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec8 edge = load(row.edges[k]) + (gather(x, row.others[k]) - own);
      sum = fma8(edge, loads_at(loads, row.loads[k]), sum);
    }
  return sum;
}

}  // namespace trocar::dynamics
