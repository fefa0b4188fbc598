#include "server/tissue/dynamics/springs.h"

#include <algorithm>
#include <cmath>

#include "server/organs/organ/any_material.h"
#include "server/tissue/topology/tet_shape.h"

namespace trocar::dynamics {
namespace {

// Squares of lengths at or below this have no direction.
constexpr float kMinLengthSquared = 1e-18f;

Float8 inverse_length(Float8 length_squared) {
  const Float8 is_long = _mm256_cmp_ps(length_squared, all(kMinLengthSquared), _CMP_GT_OQ);
  return where(is_long, all(1.0f) / _mm256_sqrt_ps(length_squared));
}

bool has_damping(const organ::Organ& organ) {
  return organ::any_material(organ,
                             [](const material::Material& m) { return m.edge_damping_time_s > 0; });
}

bool has_elasticity(const organ::Organ& organ) {
  return organ::any_material(organ, [](const material::Material& m) {
    return m.elastic_law == material::ElasticLaw::Springs;
  });
}

}  // namespace

bool Springs::are_needed(const organ::Organ& organ) {
  return has_damping(organ) || has_elasticity(organ);
}

Springs::Springs(const topology::Topology& topology, const Groups& groups)
    : has_damping_(has_damping(topology.organ())),
      has_elasticity_(has_elasticity(topology.organ())) {
  std::vector<NodeIndex> neighbours;
  std::vector<std::uint32_t> bounds(topology.node_count());
  for (std::uint32_t n = 0; n < bounds.size(); ++n) {
    topology.neighbours_of(NodeIndex(n), neighbours);
    bounds[n] = static_cast<std::uint32_t>(neighbours.size());
  }
  const auto bound = [&](NodeIndex node) { return bounds[node.value]; };
  rows_.reserve(groups, bound);
  constants_.reserve(groups, bound);
  inverse_dts_.resize(groups.group_count());
  for (Group g = 0; g < groups.group_count(); ++g) fill(topology, groups, {g, 0xff});
  rows_.end_building();
  constants_.end_building();
}

// Those that do something, by ascending other end.
void Springs::find_springs(const topology::Topology& topology, NodeIndex node,
                           std::vector<End>& out) {
  out.clear();
  const auto& organ = topology.organ();
  const auto free = topology.stress_free();
  const auto add = [&](NodeIndex other) {
    const auto [a, b] = std::minmax(node, other);
    const auto spring = organ::spring_along(free[b.value] - free[a.value],
                                            organ::material_at(organ, topology.material_of(a, b)),
                                            topology.fibre_axis(a, b), tets_);
    if (spring.stiffness_n_m != 0 || spring.damping_n_s_m != 0) out.push_back({other, spring});
  };
  tets_.clear();
  if (topology.has_links()) {
    for (const auto other : topology.links_of(node)) add(other);
    return;
  }
  tets_beside_.clear();
  for (const auto t : topology.tets_of(node))
    for (const auto other : topology.tet(t))
      if (other != node) tets_beside_.emplace_back(other, t);
  std::ranges::sort(tets_beside_);
  for (std::size_t i = 0; i < tets_beside_.size(); ++i) {
    const auto [other, t] = tets_beside_[i];
    tets_.push_back({&organ::material_at(organ, topology.material_of(t)),
                     topology::tet_shape(free, topology.tet(t)).volume});
    if (i + 1 < tets_beside_.size() && tets_beside_[i + 1].first == other) continue;
    add(other);
    tets_.clear();
  }
}

std::size_t Springs::fill(const topology::Topology& topology, const Groups& groups,
                          GroupLanes lanes) {
  const auto nodes = groups.nodes_of(lanes.group);
  std::array<std::uint32_t, kLanes> counts{};
  std::size_t written = 0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    if (!lanes.has(lane) || !nodes[lane].is_valid()) continue;
    find_springs(topology, nodes[lane], ends_[lane]);
    counts[lane] = static_cast<std::uint32_t>(ends_[lane].size());
    written += counts[lane];
  }
  const auto rows = rows_.reshape(lanes, counts);
  const auto constants = constants_.reshape(lanes, counts);
  const auto positions = topology.rest();
  for (std::size_t lane = 0; lane < kLanes; ++lane)
    for (std::size_t i = 0; i < counts[lane]; ++i) {
      const auto& [other, spring] = ends_[lane][i];
      Row& row = rows[i];
      row.neighbour.v[lane] = groups.slot_of(other);
      row.rest.set(lane, to_float(positions[other.value] - positions[nodes[lane].value]));
      row.stiffness.v[lane] = static_cast<float>(spring.stiffness_n_m);
      row.pull.v[lane] = static_cast<float>(spring.stiffness_n_m * spring.rest_length_m);
      constants[i].stiffness.v[lane] = row.stiffness.v[lane];
      constants[i].damping.v[lane] = static_cast<float>(spring.damping_n_s_m);
      constants[i].rest_length.v[lane] = static_cast<float>(spring.rest_length_m);
    }
  return written;
}

std::size_t Springs::rebuild(const topology::Topology& topology, const Groups& groups,
                             std::span<const GroupLanes> lanes) {
  rows_.extend(groups);
  constants_.extend(groups);
  inverse_dts_.resize(groups.group_count());
  std::size_t written = 0;
  for (const auto group_lanes : lanes) {
    written += fill(topology, groups, group_lanes);
    if (inverse_dt_of(group_lanes.group) != 0) update_step_length(group_lanes.group);
  }
  rows_.tidy();
  constants_.tidy();
  return written;
}

void Springs::update_step_length(Group group) {
  auto constants = constants_[group].begin();
  for (Row& row : rows_[group]) {
    const Constants& c = *constants++;
    store(row.stiffness, fma8(load(c.damping), all(inverse_dt_of(group)), load(c.stiffness)));
    store(row.pull, load(c.stiffness) * load(c.rest_length));
  }
}

void Springs::pack(const PackedLanes& pack) {
  rows_.pack(pack);
  constants_.pack(pack);
  const std::size_t index = pack.group - kFirstPack;
  packed_inverse_dts_.resize(std::max(packed_inverse_dts_.size(), index + 1));
  if (has_damping_) update_step_length(pack.group);
}

void Springs::begin_group(Group group, const Float4* start, const Vec8& own, float inverse_dt) {
  if (!has_damping_) return;
  if (inverse_dt_of(group) != inverse_dt) {
    inverse_dt_of(group) = inverse_dt;
    update_step_length(group);
  }
  if (inverse_dt == 0) return;
  auto constants = constants_[group].begin();
  for (Row& row : rows_[group]) {
    const Constants& c = *constants++;
    const Vec8 r = load(row.rest) + (gather(start, row.neighbour) - own);
    const Float8 length = _mm256_sqrt_ps(dot8(r, r));
    store(row.pull,
          fma8(load(c.damping) * all(inverse_dt), length, load(c.stiffness) * load(c.rest_length)));
  }
}

void Springs::add(Group group, const Float4* x, const Vec8& own, NodeStep8& step) const {
  // Sums live in registers: in `step` they would be stored and loaded again row after row.
  Vec8 pull = zero_vec8();
  SymMat8 block = step.block;
  Float8 identity = all(0);
  for (const Row& row : rows_[group]) {
    const Vec8 r = load(row.rest) + (gather(x, row.neighbour) - own);
    const Float8 stiffness = load(row.stiffness);
    const Float8 inverse = inverse_length(dot8(r, r));
    // Tension over length, which is also the stiffness across: k (1 - l0 / l).
    const Float8 ratio = fnma8(load(row.pull), inverse, stiffness);
    pull = fma8(r, ratio, pull);
    const Float8 across = _mm256_max_ps(ratio, all(0));
    identity = identity + across;
    block.add_outer(r, (stiffness - across) * (inverse * inverse));
  }
  step.gradient = step.gradient - pull;
  block.add_identity(identity);
  step.block = block;
}

void Springs::linearise(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
                        StiffnessSink& sink) const {
  if (!has_elasticity_) return;
  auto constants = constants_[group].begin();
  for (const Row& row : rows_[group]) {
    const Constants& c = *constants++;
    const Vec8 r = load(row.rest) + (gather(x, row.neighbour) - own);
    const Float8 stiffness = load(c.stiffness);
    const Float8 inverse = inverse_length(dot8(r, r));
    const Float8 ratio = fnma8(stiffness * load(c.rest_length), inverse, stiffness);
    const Float8 across = _mm256_max_ps(ratio, all(0));
    step.gradient = step.gradient - r * ratio;
    step.block.add_outer(r, (stiffness - across) * (inverse * inverse));
    step.block.add_identity(across);
    Mat8 other = zero_mat8();
    other.add_identity(all(0) - ratio);
    other.add_outer(r * ((ratio - stiffness) * (inverse * inverse)), r);
    sink.add(row.neighbour, other);
  }
}

void Springs::add_energies_j(std::span<const Vec3d> displacements,
                             std::span<double> energies) const {
  // Every spring is stored at both ends: half of it belongs to each.
  for (Group g = 0; g < rows_.group_count(); ++g)
    for (std::size_t i = 0; i < rows_[g].size(); ++i)
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const Row& row = rows_[g][i];
        const Constants& c = constants_[g][i];
        const Vec3d r = to_double(row.rest.at(lane)) + displacements[row.neighbour.v[lane]] -
                        displacements[g * kLanes + lane];
        const double stretch = length(r) - static_cast<double>(c.rest_length.v[lane]);
        energies[g * kLanes + lane] +=
            0.25 * static_cast<double>(c.stiffness.v[lane]) * stretch * stretch;
      }
}

}  // namespace trocar::dynamics
