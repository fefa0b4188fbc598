#include "server/tissue/reduction/element_set.h"

#include <algorithm>

#include "common/base/assert.h"
#include "server/tissue/topology/tet_shape.h"

namespace trocar::reduction {
namespace {

using dynamics::all;
using dynamics::cross8;
using dynamics::dot8;
using dynamics::Float8;
using dynamics::fma8;
using dynamics::fnma8;
using dynamics::kLanes;
using dynamics::Lanes;
using dynamics::Mat8;
using dynamics::Vec3Lanes;
using dynamics::Vec8;

Mat8 transposed(const Mat8& m) {
  return {{m.x.x, m.y.x, m.z.x}, {m.x.y, m.y.y, m.z.y}, {m.x.z, m.y.z, m.z.z}};
}
Mat8 scaled(const Mat8& m, Float8 s) {
  return {m.x * s, m.y * s, m.z * s};
}
Mat8 operator+(const Mat8& a, const Mat8& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
Vec8 product(const Mat8& m, const Vec8& v) {
  return {dot8(m.x, v), dot8(m.y, v), dot8(m.z, v)};
}
// Its columns' cross products: cof(m) (a x b) = m a x m b. Rows of cof(m) likewise.
Mat8 cofactors(const Mat8& m) {
  return {cross8(m.y, m.z), cross8(m.z, m.x), cross8(m.x, m.y)};
}

}  // namespace

// Strain holds functions of the displacement gradient H = F - I.
struct ElementSet::Strain {
  Mat8 h, cofactors;           // cof F
  Mat8 cofactors_less_linear;  // cof F - I - (tr H I - H^T) = cof H
  Float8 trace;
  Float8 i1;      // I1 - 3
  Float8 volume;  // J - 1
};

ElementSet::ElementSet(const organ::Organ& organ, std::span<const TetIndex> tets,
                       std::span<const float> weights, std::span<const NodeIndex> local_nodes)
    : tet_count_(tets.size()) {
  TROCAR_ASSERT(weights.empty() || weights.size() == tets.size());
  const auto materials = organ::material_map(organ).tets;
  for (std::size_t m = 0; m <= organ.regions.size(); ++m) {
    const auto& material = organ::material_at(organ, static_cast<std::uint16_t>(m));
    Law law = dynamics::ReducedPolynomialLaw{};
    if (material.elastic_law == material::ElasticLaw::Measured) {
      const auto& measured = material.measured;
      TROCAR_ASSERT(measured.split == material::VolumeSplit::Unsplit);
      if (measured.energy == material::StrainEnergy::Exponential) {
        law = dynamics::ExponentialLaw{static_cast<float>(measured.exponent)};
      } else {
        auto& ratios = std::get<dynamics::ReducedPolynomialLaw>(law).ratios;
        for (std::size_t i = 0; i < ratios.size(); ++i)
          ratios[i] =
              static_cast<float>(measured.coefficients_pa[i + 1] / measured.coefficients_pa[0]);
      }
    }
    laws_.push_back(law);
  }
  // By material, so that a group has one law.
  std::vector<std::size_t> order(tets.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return materials[tets[i].value]; });
  const auto local = [&](NodeIndex node) {
    const auto at = std::ranges::lower_bound(local_nodes, node);
    TROCAR_ASSERT(at != local_nodes.end() && *at == node);
    return static_cast<std::uint32_t>(at - local_nodes.begin());
  };
  for (const auto i : order) {
    const auto t = tets[i].value;
    if (groups_.empty() || groups_.back().used == kLanes || groups_.back().law != materials[t])
      groups_.emplace_back().law = materials[t];
    auto& group = groups_.back();
    const auto lane = group.used++;
    const auto& tet = organ.mesh.tets[t];
    const auto shape = topology::tet_shape(organ.mesh.rest_positions, tet);
    const auto& material = organ::material_at(organ, materials[t]);
    const auto [c10, bulk] = material::neo_hookean_parameters(material);
    const double v = shape.volume * (weights.empty() ? 1.0 : static_cast<double>(weights[i]));
    double curvature = 0;
    if (material.elastic_law == material::ElasticLaw::Measured) {
      const auto& law = material.measured;
      curvature = law.energy == material::StrainEnergy::Exponential ? c10 * law.exponent
                                                                    : 2 * law.coefficients_pa[1];
    }
    group.twice_c10_v.v[lane] = static_cast<float>(2 * c10 * v);
    group.bulk_v.v[lane] = static_cast<float>(bulk * v);
    group.curvature_v.v[lane] = static_cast<float>(4 * curvature * v);
    for (std::size_t k = 0; k < 4; ++k) group.nodes[k].v[lane] = local(tet[k]);
    for (std::size_t k = 1; k < 4; ++k)
      group.gradients[k - 1].set(lane, to_float(shape.gradients[k]));
  }
}

ElementSet::Strain ElementSet::strain_of(const Group& group, std::span<const float> u) {
  std::array<Vec3Lanes, 3> moves;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const float* first = u.data() + 3 * group.nodes[0].v[lane];
    for (std::size_t k = 0; k < 3; ++k) {
      const float* corner = u.data() + 3 * group.nodes[k + 1].v[lane];
      moves[k].set(lane, {corner[0] - first[0], corner[1] - first[1], corner[2] - first[2]});
    }
  }
  Strain s;
  s.h = dynamics::zero_mat8();
  for (std::size_t k = 0; k < 3; ++k) s.h.add_outer(load(moves[k]), load(group.gradients[k]));
  const Mat8& h = s.h;
  s.trace = h.x.x + h.y.y + h.z.z;
  s.i1 = fma8(all(2), s.trace, dot8(h.x, h.x) + dot8(h.y, h.y) + dot8(h.z, h.z));
  s.cofactors_less_linear = cofactors(h);
  const Mat8& c = s.cofactors_less_linear;
  // J - 1 = tr H + tr cof H + det H
  s.volume = s.trace + (c.x.x + c.y.y + c.z.z) + dot8(h.x, c.x);
  const Mat8 t = transposed(h);
  s.cofactors = {c.x - t.x, c.y - t.y, c.z - t.z};
  s.cofactors.add_identity(s.trace + all(1));
  return s;
}

template <typename Psi>
void ElementSet::add_forces(const Psi& law, const Group& group, ForcePart part,
                            std::span<const float> u, std::span<float> f) const {
  const Strain s = strain_of(group, u);
  Float8 first, second;
  law.derivatives(s.i1, first, second);
  const Float8 c = load(group.twice_c10_v), bulk = load(group.bulk_v);
  // V P = 2 C10 V [(Psi'/C10 - 1) F + F - cof F] + K V (J - 1) cof F
  Mat8 f_matrix = s.h;
  f_matrix.add_identity(all(1));
  Mat8 p = scaled(f_matrix, (first - all(1)) * c) + scaled(s.cofactors_less_linear, all(0) - c) +
           scaled(s.cofactors, bulk * s.volume);
  if (part == ForcePart::Whole) {
    p = p + scaled(s.h + transposed(s.h), c);
    p.add_identity(all(0) - c * s.trace);
  } else {
    p.add_identity(all(0) - (bulk + load(group.curvature_v)) * s.trace);
  }
  std::array<Vec3Lanes, 3> forces;
  for (std::size_t k = 0; k < 3; ++k) store(forces[k], product(p, load(group.gradients[k])));
  for (std::size_t lane = 0; lane < group.used; ++lane) {
    float* at_first = f.data() + 3 * group.nodes[0].v[lane];
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3f force = forces[k].at(lane);
      float* at = f.data() + 3 * group.nodes[k + 1].v[lane];
      at[0] += force.x, at[1] += force.y, at[2] += force.z;
      at_first[0] -= force.x, at_first[1] -= force.y, at_first[2] -= force.z;
    }
  }
}

void ElementSet::add_forces(ForcePart part, std::span<const float> u, std::span<float> f) const {
  for (const auto& group : groups_)
    std::visit([&](const auto& law) { add_forces(law, group, part, u, f); }, laws_[group.law]);
}

void ElementSet::add_pairs(std::vector<BlockMatrix::Pair>& pairs) const {
  for (const auto& group : groups_)
    for (std::size_t lane = 0; lane < group.used; ++lane)
      for (const auto& a : group.nodes)
        for (const auto& b : group.nodes) pairs.push_back({a.v[lane], b.v[lane]});
}

template <typename Psi>
void ElementSet::add_tangent(const Psi& law, const Group& group, std::span<const float> u,
                             bool with_stress, BlockMatrix& tangent) const {
  const Strain s = strain_of(group, u);
  Float8 first, second;
  law.derivatives(s.i1, first, second);
  const Float8 c = load(group.twice_c10_v), bulk = load(group.bulk_v);
  const Float8 slope = first * c, curvature = (second + second) * c;  // 2 Psi' V, 4 Psi'' V
  // This multiplies the change of cof F: V (K (J - 1) - 2 C10).
  const Float8 pressure = with_stress ? fma8(bulk, s.volume, all(0) - c) : all(0);
  Mat8 f = s.h;
  f.add_identity(all(1));
  std::array<Vec8, 4> g, fg, area;
  for (std::size_t k = 1; k < 4; ++k) g[k] = load(group.gradients[k - 1]);
  g[0] = dynamics::zero_vec8() - (g[1] + g[2] + g[3]);
  for (std::size_t k = 0; k < 4; ++k) {
    fg[k] = product(f, g[k]);
    area[k] = product(s.cofactors, g[k]);
  }
  for (std::size_t a = 0; a < 4; ++a)
    for (std::size_t b = a; b < 4; ++b) {
      Mat8 block = dynamics::zero_mat8();
      block.add_identity(dot8(g[a], g[b]) * slope);
      block.add_outer(fg[a] * curvature, fg[b]);
      block.add_outer(area[a] * bulk, area[b]);
      if (with_stress && a != b)
        block.add_cross(product(f, cross8(g[a], g[b])) * (all(0) - pressure));
      add_block(group, a, b, block, tangent);
    }
}

void ElementSet::add_block(const Group& group, std::size_t a, std::size_t b, const Mat8& block,
                           BlockMatrix& tangent) {
  std::array<Lanes, 9> entries;
  store(entries[0], block.x.x), store(entries[1], block.x.y), store(entries[2], block.x.z);
  store(entries[3], block.y.x), store(entries[4], block.y.y), store(entries[5], block.y.z);
  store(entries[6], block.z.x), store(entries[7], block.z.y), store(entries[8], block.z.z);
  for (std::size_t lane = 0; lane < group.used; ++lane) {
    auto& at = tangent.at(group.nodes[a].v[lane], group.nodes[b].v[lane]);
    for (std::size_t i = 0; i < 9; ++i) at[i] += entries[i].v[lane];
    if (a == b) continue;
    auto& across = tangent.at(group.nodes[b].v[lane], group.nodes[a].v[lane]);
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) across[3 * i + j] += entries[3 * j + i].v[lane];
  }
}

void ElementSet::add_rest_tangent(BlockMatrix& tangent) const {
  for (const auto& group : groups_) {
    const Float8 c = load(group.twice_c10_v);
    const Float8 volumetric = load(group.bulk_v) + load(group.curvature_v) - c;
    std::array<Vec8, 4> g;
    for (std::size_t k = 1; k < 4; ++k) g[k] = load(group.gradients[k - 1]);
    g[0] = dynamics::zero_vec8() - (g[1] + g[2] + g[3]);
    for (std::size_t a = 0; a < 4; ++a)
      for (std::size_t b = a; b < 4; ++b) {
        Mat8 block = dynamics::zero_mat8();
        block.add_identity(dot8(g[a], g[b]) * c);
        block.add_outer(g[b] * c, g[a]);
        block.add_outer(g[a] * volumetric, g[b]);
        add_block(group, a, b, block, tangent);
      }
  }
}

void ElementSet::add_tangent(std::span<const float> u, bool with_stress,
                             BlockMatrix& tangent) const {
  for (const auto& group : groups_)
    std::visit([&](const auto& law) { add_tangent(law, group, u, with_stress, tangent); },
               laws_[group.law]);
}

}  // namespace trocar::reduction
