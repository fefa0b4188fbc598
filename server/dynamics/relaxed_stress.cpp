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

void RelaxedStress::add(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
                        Scratch&) const {
  const float* const loads = relaxation_.loads();
  Vec8 gradient = step.gradient;
  Float8 identity = all(0);
  for (const Row& row : rows_[group]) {
    Float8 sum = all(0);
    for (std::size_t k = 0; k < 3; ++k) {
      const Float8 load_n_m = loads_at(loads, row.loads[k]);
      const Vec8 edge = load(row.edges[k]) + (gather(x, row.others[k]) - own);
      gradient = fma8(edge, all(0) - load_n_m, gradient);
      sum = sum + load_n_m;
    }
    identity = identity + _mm256_max_ps(sum, all(0));
  }
  step.gradient = gradient;
  step.block.add_identity(identity);
}

void RelaxedStress::linearise(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
                              StiffnessSink& sink) const {
  Scratch none;
  add(group, x, own, step, none);
  for (const Row& row : rows_[group])
    for (std::size_t k = 0; k < 3; ++k) {
      Mat8 stiffness = zero_mat8();
      stiffness.add_identity(all(0) - loads_at(relaxation_.loads(), row.loads[k]));
      sink.add(row.others[k], stiffness);
    }
}

void RelaxedStress::add_energies_j(std::span<const Vec3d> displacements,
                                   std::span<double> energies) const {
  for (Group g = 0; g < rows_.group_count(); ++g)
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const auto own = static_cast<Slot>(g * kLanes + lane);
      for (const Row& row : rows_[g])
        for (std::size_t k = 0; k < 3; ++k) {
          const Vec3d rest = to_double(row.edges[k].at(lane));
          const Vec3d now = rest + (displacements[row.others[k].v[lane]] - displacements[own]);
          const auto load_n_m = static_cast<double>(relaxation_.loads()[row.loads[k].v[lane]]);
          // Half of each edge from each end.
          energies[own] += 0.25 * load_n_m * (length_squared(now) - length_squared(rest));
        }
    }
}

}  // namespace trocar::dynamics
