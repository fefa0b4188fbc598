#include "server/tissue/dynamics/relaxed_stress.h"

#include <algorithm>

namespace trocar::dynamics {
namespace {

constexpr int kFewLanes = 3;

}  // namespace

RelaxedStress::RelaxedStress(const topology::Topology& topology, const Groups& groups,
                             const Relaxation& relaxation, const NodalStrain* strain)
    : groups_(groups),
      relaxation_(relaxation),
      nodal_strain_(strain),
      rest_(groups.slot_count()),
      forces_(groups.group_count()) {
  rows_.reserve(groups, [&](NodeIndex node) { return topology.tets_of(node).size(); });
  for (Group g = 0; g < groups.group_count(); ++g) fill(topology, groups, {g, 0xff});
  rows_.end_building();
}

void RelaxedStress::rebuild(const topology::Topology& topology, const Groups& groups,
                            std::span<const GroupLanes> lanes) {
  rows_.extend(groups);
  forces_.resize(groups.group_count());
  rest_.resize(groups.slot_count());
  for (const auto group_lanes : lanes) fill(topology, groups, group_lanes);
  rows_.tidy();
}

void RelaxedStress::fill(const topology::Topology& topology, const Groups& groups,
                         GroupLanes lanes) {
  const auto nodes = groups.nodes_of(lanes.group);
  std::array<std::uint32_t, kLanes> counts{};
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    tets_[lane].clear();
    if (!lanes.has(lane) || !nodes[lane].is_valid()) continue;
    rest_[lanes.group * kLanes + lane] = to_float4(to_float(topology.rest()[nodes[lane].value]));
    for (const auto t : topology.tets_of(nodes[lane]))
      if (relaxes(organ::material_at(topology.organ(), topology.material_of(t))))
        tets_[lane].push_back(t);
    counts[lane] = static_cast<std::uint32_t>(tets_[lane].size());
  }
  const auto rows = rows_.reshape(lanes, counts);
  for (std::size_t lane = 0; lane < kLanes; ++lane)
    for (std::size_t i = 0; i < tets_[lane].size(); ++i) {
      const auto t = tets_[lane][i];
      const auto& tet = topology.tet(t);
      const auto own = static_cast<std::size_t>(std::ranges::find(tet, nodes[lane]) - tet.begin());
      rows[i].loads.v[lane] = Relaxation::loads_index(t, own);
      for (std::size_t k = 0; k < 3; ++k)
        rows[i].others[k].v[lane] = groups.slot_of(tet[(own + 1 + k) % 4]);
    }
}

Vec8 RelaxedStress::nodal_forces(Group group) const {
  Vec8 sum = zero_vec8();
  const Float4* const q = relaxation_.nodal()->relaxed();
  for (const auto& row : nodal_strain_->rows(group)) {
    const Vec8 b = load(row.part);
    const Vec8 qb{dot8(gather(q, row.domain), b), dot8(gather(q + 1, row.domain), b),
                  dot8(gather(q + 2, row.domain), b)};
    const auto f = nodal_strain_->gradient_at(row.domain);
    sum = sum + Vec8{dot8(f.rows[0], qb), dot8(f.rows[1], qb), dot8(f.rows[2], qb)};
  }
  return sum;
}

// Along an edge a stress pulls its ends together; what has relaxed of it lets them go.
Vec8 RelaxedStress::forces_at(Group group, const Float4* x) const {
  const auto* const all_loads = relaxation_.loads();
  const Float4* const rest = rest_.data();
  // They lie all over the memory: so all are on their way at once.
  for (const Row& row : rows_[group])
    for (const auto index : row.loads.v) Relaxation::prefetch(all_loads, index);
  const Vec8 own = load_group(x + group * kLanes), own_rest = load_group(rest + group * kLanes);
  Vec8 sum = zero_vec8();
  const auto edge = [&](const Row& row, std::size_t k) {
    return (gather(rest, row.others[k]) - own_rest) + (gather(x, row.others[k]) - own);
  };
  for (const Row& row : rows_[group]) {
    const auto pair = [&](std::size_t lane) {
      return _mm256_insertf128_ps(
          _mm256_castps128_ps256(Relaxation::loads_of_corner(all_loads, row.loads.v[lane])),
          Relaxation::loads_of_corner(all_loads, row.loads.v[lane + 4]), 1);
    };
    const Vec8 loads = transpose4(pair(0), pair(1), pair(2), pair(3));
    sum = fma8(edge(row, 0), loads.x, sum);
    sum = fma8(edge(row, 1), loads.y, sum);
    sum = fma8(edge(row, 2), loads.z, sum);
  }
  return sum;
}

// The same to the bit: where few lanes are asked for, one after another is quicker.
Vec3f RelaxedStress::force_at(Group group, std::size_t lane, const Float4* x) const {
  const auto* const all_loads = relaxation_.loads();
  const auto at = [](const Float4* values, Slot slot) { return _mm_load_ps(&values[slot].x); };
  const auto slot = static_cast<Slot>(group * kLanes + lane);
  const __m128 own = at(x, slot), own_rest = at(rest_.data(), slot);
  __m128 sum = _mm_setzero_ps();
  for (const Row& row : rows_[group]) {
    Float4 loads;
    _mm_store_ps(&loads.x, Relaxation::loads_of_corner(all_loads, row.loads.v[lane]));
    const auto add = [&](std::size_t k, float load_n_m) {
      const Slot other = row.others[k].v[lane];
      const __m128 edge =
          _mm_add_ps(_mm_sub_ps(at(rest_.data(), other), own_rest), _mm_sub_ps(at(x, other), own));
      sum = _mm_fmadd_ps(edge, _mm_set1_ps(load_n_m), sum);
    };
    add(0, loads.x), add(1, loads.y), add(2, loads.z);
  }
  Float4 force;
  _mm_store_ps(&force.x, sum);
  return to_vec3(force);
}

void RelaxedStress::refresh(GroupLanes lanes, const Float4* x, world::RelaxationState& state) {
  const auto group = lanes.group;
  const bool are_few = __builtin_popcount(lanes.lanes) <= kFewLanes;
  Vec3Lanes all;
  if (!are_few) store(all, forces_at(group, x));
  Vec3Lanes nodal;
  if (nodal_strain_ != nullptr && relaxation_.nodal() != nullptr) store(nodal, nodal_forces(group));
  const auto nodes = groups_.nodes_of(group);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    if (!lanes.has(lane)) continue;
    const Vec3f force = (are_few ? force_at(group, lane, x) : all.at(lane)) + nodal.at(lane);
    forces_[group].set(lane, force);
    if (nodes[lane].is_valid()) state.set_force(nodes[lane], force);
  }
}

void RelaxedStress::read_state(const world::RelaxationState& state) {
  for (Group g = 0; g < groups_.group_count(); ++g)
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      if (const auto node = groups_.nodes_of(g)[lane]; node.is_valid())
        forces_[g].set(lane, state.forces()[node.value]);
}

void start_relaxed(const organ::Organ& organ, world::World& world, StrainScheme scheme) {
  if (!Relaxation::is_needed(organ)) return;
  const topology::Topology topology(organ);
  const Groups groups(topology, Coupling::Elements);
  std::optional<NodalStrain> strain;
  if (NodalStrain::are_needed(organ)) strain.emplace(topology, groups);
  std::vector<Float4> x(groups.slot_count());
  for (Slot slot = 0; slot < x.size(); ++slot)
    if (const auto node = groups.node_at(slot); node.is_valid())
      x[slot] = to_float4(world.displacements[node.value]);
  const NodalStrain* const averaged = strain ? &*strain : nullptr;
  for (Group g = 0; strain && g < groups.group_count(); ++g) strain->restart_group(g, x.data());
  Relaxation relaxation(topology, groups, averaged, scheme);
  relaxation.settle(x.data(), world.relaxation);
  // The loads of tissue that stays as it is do not depend on the step.
  Workers alone(1);
  relaxation.begin_step(1, world.relaxation, alone);
  RelaxedStress stress(topology, groups, relaxation,
                       scheme == StrainScheme::Implicit ? averaged : nullptr);
  for (Group g = 0; g < groups.group_count(); ++g)
    stress.refresh({g, 0xff}, x.data(), world.relaxation);
}

}  // namespace trocar::dynamics
