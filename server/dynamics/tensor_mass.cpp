#include "server/dynamics/tensor_mass.h"

#include <algorithm>

#include "server/dynamics/tet_shape.h"

namespace trocar::dynamics {
namespace {

struct Matrix {
  std::array<std::array<double, 3>, 3> m{};

  Vec3d operator*(const Vec3d& v) const {
    const auto row = [&](std::size_t i) { return m[i][0] * v.x + m[i][1] * v.y + m[i][2] * v.z; };
    return {row(0), row(1), row(2)};
  }
  void add(const Matrix& b, double sign) {
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) m[i][j] += sign * b.m[i][j];
  }
};

Matrix edge_matrix(const Vec3d& gi, const Vec3d& gj, double volume,
                   const scene::LameParameters& lame) {
  const std::array<double, 3> a{gi.x, gi.y, gi.z}, b{gj.x, gj.y, gj.z};
  const double trace = lame.mu_pa * dot(gi, gj);
  Matrix k;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      k.m[i][j] =
          volume * (lame.lambda_pa * a[i] * b[j] + lame.mu_pa * b[i] * a[j] + (i == j ? trace : 0));
  return k;
}

struct Edge {
  NodeIndex other;
  Matrix k;
};

}  // namespace

TensorMass::TensorMass(const scene::Organ& organ, const Groups& groups) {
  const auto& mesh = organ.mesh;
  const auto map = scene::material_map(organ);
  std::vector<std::vector<Edge>> edges(mesh.node_count());
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const auto& material = scene::material_at(organ, map.tets[t]);
    if (material.elastic_law != scene::ElasticLaw::TensorMass) continue;
    const auto lame = scene::lame_parameters(material);
    const auto shape = tet_shape(organ.stress_free(), mesh.tets[t]);
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = 0; j < 4; ++j) {
        if (i == j) continue;
        auto& row = edges[mesh.tets[t][i].value];
        auto found = std::ranges::find(row, mesh.tets[t][j], &Edge::other);
        if (found == row.end()) found = row.insert(row.end(), {mesh.tets[t][j], {}});
        found->k.add(edge_matrix(shape.gradients[i], shape.gradients[j], shape.volume, lame), 1);
      }
  }
  std::vector<std::uint32_t> counts;
  for (auto& row : edges) {
    std::ranges::sort(row, {}, &Edge::other);
    counts.push_back(static_cast<std::uint32_t>(row.size()));
  }
  rows_ = make_rows<Row>(groups, counts,
                         [&](Row& row, std::size_t lane, NodeIndex node, std::uint32_t e) {
                           const Edge& edge = edges[node.value][e];
                           row.neighbour.v[lane] = groups.slot_of(edge.other);
                           for (std::size_t i = 0; i < 3; ++i)
                             for (std::size_t j = 0; j < 3; ++j)
                               row.k[i][j].v[lane] = static_cast<float>(edge.k.m[i][j]);
                         });
  blocks_.resize(groups.group_count());
  rest_gradient_.resize(groups.group_count());
  const auto strain_of_rest = [&](std::uint32_t n) {
    return mesh.rest_positions[n] - organ.stress_free()[n];
  };
  for (std::uint32_t n = 0; n < mesh.node_count(); ++n) {
    const Slot slot = groups.slot_of(NodeIndex(n));
    Matrix own;
    Vec3d gradient;
    for (const Edge& edge : edges[n]) {
      own.add(edge.k, -1);
      gradient += edge.k * (strain_of_rest(edge.other.value) - strain_of_rest(n));
    }
    const auto f = [&](std::size_t i, std::size_t j) { return static_cast<float>(own.m[i][j]); };
    blocks_[slot / kLanes].set(slot % kLanes,
                               {f(0, 0), f(0, 1), f(0, 2), f(1, 1), f(1, 2), f(2, 2)});
    rest_gradient_[slot / kLanes].set(slot % kLanes, to_float(gradient));
    rest_energy_j_ += 0.5 * dot(strain_of_rest(n), gradient);
  }
}

void TensorMass::add(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
                     Scratch&) const {
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

double TensorMass::energy_j(std::span<const Vec3d> displacements) const {
  double energy = rest_energy_j_;
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
      energy += dot(own, gradient * 0.5 + to_double(rest_gradient_[g].at(lane)));
    }
  return energy;
}

}  // namespace trocar::dynamics
