#include "server/tissue/dynamics/tensor_mass.h"

#include <algorithm>

#include "server/tissue/topology/tet_shape.h"

namespace trocar::dynamics {

Vec3d TensorMass::Matrix::operator*(const Vec3d& v) const {
  const auto row = [&](std::size_t i) { return m[i][0] * v.x + m[i][1] * v.y + m[i][2] * v.z; };
  return {row(0), row(1), row(2)};
}

void TensorMass::Matrix::add(const Matrix& b, double sign) {
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) m[i][j] += sign * b.m[i][j];
}

TensorMass::Matrix TensorMass::edge_matrix(const Vec3d& gi, const Vec3d& gj, double volume,
                                           const material::LameParameters& lame) {
  const std::array<double, 3> a{gi.x, gi.y, gi.z}, b{gj.x, gj.y, gj.z};
  const double trace = lame.mu_pa * dot(gi, gj);
  Matrix k;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      k.m[i][j] =
          volume * (lame.lambda_pa * a[i] * b[j] + lame.mu_pa * b[i] * a[j] + (i == j ? trace : 0));
  return k;
}

namespace {

// Stress of tissue under tension, sigma = lambda tr(e) I + 2 mu e for the strain e = I - A that is
// missing (A: stress_free_shape()), and its energy per volume.
struct Tension {
  double isotropic_pa = 0, mu_pa = 0, energy_pa = 0;
  const material::Material& material;
  Vec3d fibres;

  Vec3d stress_on(const Vec3d& v) const {
    return v * isotropic_pa + (v - topology::relaxed(material, fibres, v)) * (2 * mu_pa);
  }
};

Tension tension_of(const material::Material& material, const Vec3d& fibres,
                   const material::LameParameters& lame) {
  const double all = material.tension;
  const double along = length_squared(fibres) > 0 ? material.fibre_tension : 0;
  const double trace = 3 * all + along;
  const double squared = 3 * all * all + 2 * all * along + along * along;
  return {lame.lambda_pa * trace, lame.mu_pa,
          0.5 * lame.lambda_pa * trace * trace + lame.mu_pa * squared, material, fibres};
}

}  // namespace

TensorMass::TensorMass(const topology::Topology& topology, const Groups& groups) {
  std::vector<NodeIndex> neighbours;
  std::vector<std::uint32_t> bounds(topology.node_count());
  for (std::uint32_t n = 0; n < bounds.size(); ++n) {
    topology.neighbours_of(NodeIndex(n), neighbours);
    bounds[n] = static_cast<std::uint32_t>(neighbours.size());
  }
  rows_.reserve(groups, [&](NodeIndex node) { return bounds[node.value]; });
  blocks_.resize(groups.group_count());
  rest_gradient_.resize(groups.group_count());
  rest_energies_j_.resize(groups.slot_count());
  for (Group g = 0; g < groups.group_count(); ++g) fill(topology, groups, {g, 0xff});
  rows_.end_building();
}

// By ascending other end; each a sum over ascending tets.
void TensorMass::find_edges(const topology::Topology& topology, NodeIndex node, Node& out) {
  out.edges.clear();
  out.gradient_n = {};
  out.energy_j = 0;
  const auto strain_of_rest = [&](NodeIndex n) {
    return topology.rest()[n.value] - topology.stress_free()[n.value];
  };
  for (const auto t : topology.tets_of(node)) {
    const auto& material = organ::material_at(topology.organ(), topology.material_of(t));
    if (material.elastic_law != material::ElasticLaw::TensorMass) continue;
    const auto lame = material::lame_parameters(material);
    const auto& tet = topology.tet(t);
    const auto shape = topology::tet_shape(topology.stress_free(), tet);
    const auto i = static_cast<std::size_t>(std::ranges::find(tet, node) - tet.begin());
    Vec3d gradient;
    for (std::size_t j = 0; j < 4; ++j) {
      if (i == j) continue;
      auto found = std::ranges::find(out.edges, tet[j], &Edge::other);
      if (found == out.edges.end()) found = out.edges.insert(out.edges.end(), {tet[j], {}});
      const auto k = edge_matrix(shape.gradients[i], shape.gradients[j], shape.volume, lame);
      found->k.add(k, 1);
      gradient += k * (strain_of_rest(tet[j]) - strain_of_rest(node));
    }
    const auto tension =
        tension_of(material, organ::fibres_in(material, topology.fibre_axis(t)), lame);
    const Vec3d pull = tension.stress_on(shape.gradients[i]) * shape.volume;
    out.gradient_n += gradient + pull;
    out.energy_j += 0.5 * dot(strain_of_rest(node), gradient) + dot(strain_of_rest(node), pull) +
                    shape.volume / 4 * tension.energy_pa;
  }
  std::ranges::sort(out.edges, {}, &Edge::other);
}

std::size_t TensorMass::fill(const topology::Topology& topology, const Groups& groups,
                             GroupLanes lanes) {
  const auto nodes = groups.nodes_of(lanes.group);
  std::array<std::uint32_t, kLanes> counts{};
  std::size_t written = 0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    if (!lanes.has(lane)) continue;
    Node& node = lane_nodes_[lane];
    node.edges.clear();
    if (nodes[lane].is_valid()) find_edges(topology, nodes[lane], node);
    counts[lane] = static_cast<std::uint32_t>(node.edges.size());
    written += counts[lane];
    set_node(node, static_cast<Slot>(lanes.group * kLanes + lane));
  }
  const auto rows = rows_.reshape(lanes, counts);
  for (std::size_t lane = 0; lane < kLanes; ++lane)
    for (std::size_t e = 0; e < counts[lane]; ++e) {
      const Edge& edge = lane_nodes_[lane].edges[e];
      rows[e].neighbour.v[lane] = groups.slot_of(edge.other);
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j)
          rows[e].k[i][j].v[lane] = static_cast<float>(edge.k.m[i][j]);
    }
  return written;
}

// Quantities of the node itself: zero where there is none.
void TensorMass::set_node(const Node& node, Slot slot) {
  Matrix own;
  for (const Edge& edge : node.edges) own.add(edge.k, -1);
  const auto f = [&](std::size_t i, std::size_t j) { return static_cast<float>(own.m[i][j]); };
  blocks_[slot / kLanes].set(slot % kLanes, {f(0, 0), f(0, 1), f(0, 2), f(1, 1), f(1, 2), f(2, 2)});
  const bool is_empty = node.edges.empty();
  rest_gradient_[slot / kLanes].set(slot % kLanes, is_empty ? Vec3f{} : to_float(node.gradient_n));
  rest_energies_j_[slot] = is_empty ? 0 : node.energy_j;
}

std::size_t TensorMass::rebuild(const topology::Topology& topology, const Groups& groups,
                                std::span<const GroupLanes> lanes) {
  rows_.extend(groups);
  blocks_.resize(groups.group_count());
  rest_gradient_.resize(groups.group_count());
  rest_energies_j_.resize(groups.slot_count());
  std::size_t written = 0;
  for (const auto group_lanes : lanes) written += fill(topology, groups, group_lanes);
  rows_.tidy();
  return written;
}

void TensorMass::pack(const PackedLanes& pack) {
  rows_.pack(pack);
  blocks_.pack(pack);
  rest_gradient_.pack(pack);
}

void TensorMass::add(Group group, const Float4* x, const Vec8& own, NodeStep8& step) const {
  Vec8 g = step.gradient + load(rest_gradient_[group]);
  for (const Row& row : rows_[group]) {
    const Vec8 d = gather(x, row.neighbour) - own;
    const auto line = [&](std::size_t i, Float8 sum) {
      return fma8(load(row.k[i][2]), d.z,
                  fma8(load(row.k[i][1]), d.y, fma8(load(row.k[i][0]), d.x, sum)));
    };
    g = {line(0, g.x), line(1, g.y), line(2, g.z)};
  }
  step.gradient = g;
  const SymMat8 own_block = load(blocks_[group]);
  step.block = {step.block.xx + own_block.xx, step.block.xy + own_block.xy,
                step.block.xz + own_block.xz, step.block.yy + own_block.yy,
                step.block.yz + own_block.yz, step.block.zz + own_block.zz};
}

void TensorMass::linearise(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
                           StiffnessSink& sink) const {
  add(group, x, own, step);
  for (const Row& row : rows_[group]) {
    const auto line = [&](std::size_t i) {
      return Vec8{load(row.k[i][0]), load(row.k[i][1]), load(row.k[i][2])};
    };
    sink.add(row.neighbour, {line(0), line(1), line(2)});
  }
}

void TensorMass::add_energies_j(std::span<const Vec3d> displacements,
                                std::span<double> energies) const {
  for (Group g = 0; g < blocks_.size(); ++g)
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const Vec3d own = displacements[g * kLanes + lane];
      Vec3d gradient;
      for (const Row& row : rows_[g]) {
        const Vec3d d = displacements[row.neighbour.v[lane]] - own;
        const auto line = [&](std::size_t i) {
          const auto k = [&](std::size_t j) { return static_cast<double>(row.k[i][j].v[lane]); };
          return k(0) * d.x + k(1) * d.y + k(2) * d.z;
        };
        gradient += {line(0), line(1), line(2)};
      }
      energies[g * kLanes + lane] +=
          rest_energies_j_[g * kLanes + lane] +
          dot(own, gradient * 0.5 + to_double(rest_gradient_[g].at(lane)));
    }
}

}  // namespace trocar::dynamics
