#include "server/tissue/dynamics/hyperelastic.h"

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include "common/base/assert.h"
#include "server/tissue/topology/tet_shape.h"

namespace trocar::dynamics {
namespace {

// Nodes of a tet with `first` in front, in an order of positive volume.
mesh::Tet seen_from(const mesh::Tet& tet, NodeIndex first) {
  const auto [a, b, c, d] = tet;
  if (first == a) return {a, b, c, d};
  if (first == b) return {b, a, d, c};
  if (first == c) return {c, d, a, b};
  return {d, c, b, a};
}

}  // namespace

template <typename Law>
struct Hyperelastic<Law>::RowShape {
  Vec8 db, rb, ec, ed, area;  // displacement and vector a to b, vectors b to c and d, m; 2 x area
  Vec8 dc, dd;                // displacements of c and d from a's
};

template <typename Law>
Hyperelastic<Law>::Hyperelastic(const topology::Topology& topology, const Groups& groups,
                                const NodalStrain* strain, HyperelasticParameters parameters,
                                const Law& law)
    : law_(law), nodal_strain_(strain), parameters_(std::move(parameters)) {
  const auto bound = [&](NodeIndex node) { return topology.tets_of(node).size(); };
  rows_.reserve(groups, bound);
  if constexpr (!Law::kIsLinear) invariant_rows_.reserve(groups, bound);
  if (nodal_strain_ != nullptr) guard_rows_.reserve(groups, bound);
  extend(groups);
  for (Group g = 0; g < groups.group_count(); ++g) fill(topology, groups, {g, 0xff});
  rows_.end_building();
  invariant_rows_.end_building();
  guard_rows_.end_building();
}

template <typename Law>
void Hyperelastic<Law>::extend(const Groups& groups) {
  rows_.extend(groups);
  if (nodal_strain_ != nullptr) guard_rows_.extend(groups);
  if constexpr (Law::kIsLinear) {
    constant_gradient_.resize(groups.group_count());
    constant_block_.resize(groups.group_count());
  } else {
    invariant_rows_.extend(groups);
  }
}

template <typename Law>
std::size_t Hyperelastic<Law>::rebuild(const topology::Topology& topology, const Groups& groups,
                                       std::span<const GroupLanes> lanes) {
  extend(groups);
  std::size_t written = 0;
  for (const auto group_lanes : lanes) written += fill(topology, groups, group_lanes);
  rows_.tidy();
  invariant_rows_.tidy();
  guard_rows_.tidy();
  return written;
}

template <typename Law>
void Hyperelastic<Law>::find_tets(const topology::Topology& topology, NodeIndex node,
                                  std::vector<At>& out) const {
  out.clear();
  for (const auto t : topology.tets_of(node)) {
    const auto material = topology.material_of(t);
    if (!parameters_[material]) continue;
    const auto [c10, bulk] = *parameters_[material];
    const auto tet = seen_from(topology.tet(t), node);
    const auto left =
        nodal_strain_ == nullptr ? NodalStrain::Left{} : nodal_strain_->left_to(topology, t);
    out.push_back({tet, c10 * left.bracket, bulk * left.volumetric, bulk * (1 - left.volumetric),
                   topology::stress_free_shape(topology, t, tet)});
  }
}

template <typename Law>
std::size_t Hyperelastic<Law>::fill(const topology::Topology& topology, const Groups& groups,
                                    GroupLanes lanes) {
  const auto nodes = groups.nodes_of(lanes.group);
  std::array<std::uint32_t, kLanes> counts{};
  std::size_t written = 0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    if (!lanes.has(lane)) continue;
    tets_[lane].clear();
    if (nodes[lane].is_valid()) find_tets(topology, nodes[lane], tets_[lane]);
    counts[lane] = static_cast<std::uint32_t>(tets_[lane].size());
    written += counts[lane];
  }
  rows_.reshape(lanes, counts);
  if constexpr (!Law::kIsLinear) invariant_rows_.reshape(lanes, counts);
  if (nodal_strain_ != nullptr) guard_rows_.reshape(lanes, counts);
  for (std::size_t lane = 0; lane < kLanes; ++lane)
    if (lanes.has(lane)) fill_lane(topology, groups, tets_[lane], lanes.group, lane);
  return written;
}

template <typename Law>
void Hyperelastic<Law>::fill_lane(const topology::Topology& topology, const Groups& groups,
                                  std::span<const At> tets, Group group, std::size_t lane) {
  const auto rest = topology.rest();
  const auto rows = rows_[group];
  Vec3d constant_gradient;
  double constant_block = 0;
  for (std::size_t i = 0; i < tets.size(); ++i) {
    const auto& [tet, c10, bulk, averaged_bulk, shape] = tets[i];
    const auto& g = shape.gradients;
    const double scale = 2 * c10 * shape.volume;
    std::array<double, 4> w{};
    for (std::size_t k = 1; k < 4; ++k) {
      w[k] = scale * dot(g[0], g[k]);
      constant_gradient += (rest[tet[k].value] - rest[tet[0].value]) * w[k];
      constant_block -= w[k];
    }
    Row& row = rows[i];
    row.b.v[lane] = groups.slot_of(tet[1]);
    row.c.v[lane] = groups.slot_of(tet[2]);
    row.d.v[lane] = groups.slot_of(tet[3]);
    row.wb.v[lane] = static_cast<float>(w[1]);
    row.wc.v[lane] = static_cast<float>(w[2]);
    row.wd.v[lane] = static_cast<float>(w[3]);
    row.ab.set(lane, to_float(rest[tet[1].value] - rest[tet[0].value]));
    row.bc.set(lane, to_float(rest[tet[2].value] - rest[tet[1].value]));
    row.bd.set(lane, to_float(rest[tet[3].value] - rest[tet[1].value]));
    row.volumetric.v[lane] = static_cast<float>(bulk / (36 * shape.volume));
    row.pressure.v[lane] = static_cast<float>(c10 / 3 + bulk / 6);
    if (nodal_strain_ != nullptr) {
      GuardRow& guard = guard_rows_[group][i];
      guard.stiffness.v[lane] = static_cast<float>(averaged_bulk / (36 * shape.volume));
      guard.least_volume.v[lane] = static_cast<float>(6 * kLeastVolume * shape.volume);
    }
    if constexpr (!Law::kIsLinear) {
      InvariantRow& extra = invariant_rows_[group][i];
      extra.wbc.v[lane] = static_cast<float>(scale * dot(g[1], g[2]));
      extra.wbd.v[lane] = static_cast<float>(scale * dot(g[1], g[3]));
      extra.wcd.v[lane] = static_cast<float>(scale * dot(g[2], g[3]));
      extra.inverse_c10_v2.v[lane] = static_cast<float>(1 / scale);
    }
  }
  if constexpr (Law::kIsLinear) {
    constant_gradient_[group].set(lane, to_float(constant_gradient));
    constant_block_[group].v[lane] = static_cast<float>(constant_block);
  }
}

template <typename Law>
typename Hyperelastic<Law>::RowShape Hyperelastic<Law>::shape(const Row& row, const Float4* x,
                                                              const Vec8& own) {
  const Vec8 ub = gather(x, row.b), uc = gather(x, row.c), ud = gather(x, row.d);
  RowShape s;
  s.db = ub - own;
  s.dc = uc - own;
  s.dd = ud - own;
  s.rb = load(row.ab) + s.db;
  s.ec = load(row.bc) + (uc - ub);
  s.ed = load(row.bd) + (ud - ub);
  s.area = cross8(s.ed, s.ec);  // dV/dx_a = area / 6
  return s;
}

// Pressure: a sixth of K (J - 1) - 2 C10; V = area . (a - b) / 6.
template <typename Law>
typename Hyperelastic<Law>::Volumetric Hyperelastic<Law>::volumetric(const Row& row,
                                                                     const GuardRow* guard,
                                                                     const RowShape& shape) {
  const Float8 stiffness = load(row.volumetric), minus_six_volumes = dot8(shape.area, shape.rb);
  const Float8 pressure = fnma8(stiffness, minus_six_volumes, all(0) - load(row.pressure));
  if (guard == nullptr) return {stiffness, pressure};
  const Float8 lacks = load(guard->least_volume) + minus_six_volumes;
  const Float8 is_folded = _mm256_cmp_ps(lacks, all(0), _CMP_GT_OQ);
  if (_mm256_movemask_ps(is_folded) == 0) return {stiffness, pressure};
  const Float8 guarding = where(is_folded, load(guard->stiffness));
  return {stiffness + guarding, fnma8(guarding, lacks, pressure)};
}

template <typename Law>
void Hyperelastic<Law>::pack(const PackedLanes& pack) {
  rows_.pack(pack);
  if (nodal_strain_ != nullptr) guard_rows_.pack(pack);
  if constexpr (Law::kIsLinear) {
    constant_gradient_.pack(pack);
    constant_block_.pack(pack);
  } else {
    invariant_rows_.pack(pack);
  }
}

template <typename Law>
void Hyperelastic<Law>::add(Group group, const Float4* x, const Vec8& own, NodeStep8& step) const {
  const auto rows = rows_[group];
  [[maybe_unused]] std::span<const InvariantRow> invariant_rows;
  if constexpr (!Law::kIsLinear) invariant_rows = invariant_rows_[group];
  std::span<const GuardRow> guards;
  if (nodal_strain_ != nullptr) guards = guard_rows_[group];
  // Sums live in registers: in `step` they would be stored and loaded again row after row.
  Vec8 gradient = step.gradient;
  SymMat8 block = step.block;
  [[maybe_unused]] Float8 identity = all(0);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row& row = rows[i];
    const RowShape s = shape(row, x, own);
    if constexpr (Law::kIsLinear) {
      gradient = fma8(s.db, load(row.wb), gradient);
      gradient = fma8(s.dc, load(row.wc), gradient);
      gradient = fma8(s.dd, load(row.wd), gradient);
    } else {
      const InvariantRow& extra = invariant_rows[i];
      const Vec8 rc = s.rb + s.ec, rd = s.rb + s.ed, cd = s.ed - s.ec;
      const Float8 wb = load(row.wb), wc = load(row.wc), wd = load(row.wd);
      const Float8 sum =
          fma8(wb, dot8(s.rb, s.rb), fma8(wc, dot8(rc, rc), wd * dot8(rd, rd))) +
          fma8(load(extra.wbc), dot8(s.ec, s.ec),
               fma8(load(extra.wbd), dot8(s.ed, s.ed), load(extra.wcd) * dot8(cd, cd)));
      const Float8 inverse = load(extra.inverse_c10_v2);
      Float8 first, second;
      law_.derivatives(fnma8(sum, inverse, all(-3.0f)), first, second);
      const Vec8 half_di1 = fma8(s.rb, wb, fma8(rc, wc, rd * wd));  // C10 V dI1
      gradient = fma8(half_di1, first, gradient);
      identity = fnma8(wb + wc + wd, first, identity);
      // C10 V Psi''/C10 dI1 dI1^T with dI1 = half_di1 / (C10 V)
      block.add_outer(half_di1, second * (inverse + inverse));
    }
    const auto [stiffness, pressure] = volumetric(row, guards.empty() ? nullptr : &guards[i], s);
    block.add_outer(s.area, stiffness);
    gradient = fma8(s.area, pressure, gradient);
  }
  if constexpr (Law::kIsLinear) {
    gradient = gradient + load(constant_gradient_[group]);
    identity = load(constant_block_[group]);
  }
  block.add_identity(identity);
  step = {gradient, block};
}

template <typename Law>
void Hyperelastic<Law>::linearise(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
                                  StiffnessSink& sink) const {
  add(group, x, own, step);
  const auto rows = rows_[group];
  std::span<const GuardRow> guards;
  if (nodal_strain_ != nullptr) guards = guard_rows_[group];
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row& row = rows[i];
    const RowShape s = shape(row, x, own);
    const auto [stiffness, pressure] = volumetric(row, guards.empty() ? nullptr : &guards[i], s);
    // Six times the derivatives of the volume.
    const Vec8 of_c = cross8(s.ed, s.rb), of_d = cross8(s.rb, s.ec);
    const Vec8 of_b = zero_vec8() - (s.area + of_c + of_d);
    const Vec8 stiff_area = s.area * stiffness;
    Mat8 b = zero_mat8(), c = b, d = b;
    b.add_outer(stiff_area, of_b), b.add_cross((s.ec - s.ed) * pressure);
    c.add_outer(stiff_area, of_c), c.add_cross(s.ed * pressure);
    d.add_outer(stiff_area, of_d), d.add_cross(s.ec * (all(0) - pressure));
    const Float8 wb = load(row.wb), wc = load(row.wc), wd = load(row.wd);
    Float8 first = all(1);
    if constexpr (!Law::kIsLinear) {
      const InvariantRow& extra = invariant_rows_[group][i];
      const Float8 wbc = load(extra.wbc), wbd = load(extra.wbd), wcd = load(extra.wcd);
      const Vec8 rc = s.rb + s.ec, rd = s.rb + s.ed, cd = s.ed - s.ec;
      const Float8 sum =
          fma8(wb, dot8(s.rb, s.rb), fma8(wc, dot8(rc, rc), wd * dot8(rd, rd))) +
          fma8(wbc, dot8(s.ec, s.ec), fma8(wbd, dot8(s.ed, s.ed), wcd * dot8(cd, cd)));
      const Float8 inverse = load(extra.inverse_c10_v2);
      Float8 second;
      law_.derivatives(fnma8(sum, inverse, all(-3.0f)), first, second);
      const Vec8 toward_b = s.rb * wb, toward_c = rc * wc, toward_d = rd * wd;
      const Vec8 half = (toward_b + toward_c + toward_d) * (second * (inverse + inverse));
      b.add_outer(half, fma8(s.ec, wbc, s.ed * wbd) - toward_b);
      c.add_outer(half, fma8(cd, wcd, zero_vec8() - s.ec * wbc) - toward_c);
      d.add_outer(half, zero_vec8() - (fma8(cd, wcd, s.ed * wbd) + toward_d));
    }
    b.add_identity(wb * first), c.add_identity(wc * first), d.add_identity(wd * first);
    sink.add(row.b, b), sink.add(row.c, c), sink.add(row.d, d);
  }
}

template <typename Law>
double Hyperelastic<Law>::row_energy(const Row& row, const InvariantRow* extra,
                                     const GuardRow* guard, std::size_t lane, Slot own,
                                     std::span<const Vec3d> u) const {
  const auto at = [&](const Lanes& l) { return static_cast<double>(l.v[lane]); };
  const Vec3d ub = u[row.b.v[lane]], uc = u[row.c.v[lane]], ud = u[row.d.v[lane]];
  const Vec3d ab0 = to_double(row.ab.at(lane)), bc0 = to_double(row.bc.at(lane)),
              bd0 = to_double(row.bd.at(lane));
  const Vec3d ab = ab0 + (ub - u[own]), bc = bc0 + (uc - ub), bd = bd0 + (ud - ub);
  const double six_volumes = -dot(cross(bd, bc), ab);
  // Every tet is stored at four nodes; the edges at this one are stored at two.
  double energy = 0;
  const Vec3d ac = ab + bc, ad = ab + bd;
  if constexpr (Law::kIsLinear) {
    static_cast<void>(extra);
    // C10 V I1 = -1/2 sum over edges of (2 C10 V w) |.|^2, half of each edge from each end.
    energy -= 0.25 * (at(row.wb) * length_squared(ab) + at(row.wc) * length_squared(ac) +
                      at(row.wd) * length_squared(ad));
  } else {
    const double inverse = at(extra->inverse_c10_v2);
    const double sum = at(row.wb) * length_squared(ab) + at(row.wc) * length_squared(ac) +
                       at(row.wd) * length_squared(ad) + at(extra->wbc) * length_squared(bc) +
                       at(extra->wbd) * length_squared(bd) +
                       at(extra->wcd) * length_squared(bd - bc);
    energy += 0.25 * law_.energy(-sum * inverse - 3) / (2 * inverse);
  }
  // -2 C10 V (J - 1) and K/2 V (J - 1)^2 without constants: with p = pressure, v = volumetric,
  // 6 V_now = s: d/ds of the sum is (v s - p) / 6.
  energy -= 0.25 * at(row.pressure) * six_volumes;
  energy += 0.25 * 0.5 * at(row.volumetric) * six_volumes * six_volumes;
  if (guard != nullptr) {
    const double lacks = std::max(0.0, at(guard->least_volume) - six_volumes);
    energy += 0.25 * 0.5 * at(guard->stiffness) * lacks * lacks;
  }
  return energy;
}

template <typename Law>
void Hyperelastic<Law>::add_energies_j(std::span<const Vec3d> displacements,
                                       std::span<double> energies) const {
  for (Group g = 0; g < rows_.group_count(); ++g)
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const auto own = static_cast<Slot>(g * kLanes + lane);
      double energy = 0;
      for (std::size_t i = 0; i < rows_[g].size(); ++i) {
        const Row& row = rows_[g][i];
        if (row.b.v[lane] == own) break;  // padding
        const InvariantRow* extra = nullptr;
        if constexpr (!Law::kIsLinear) extra = &invariant_rows_[g][i];
        const GuardRow* guard = nodal_strain_ == nullptr ? nullptr : &guard_rows_[g][i];
        energy += row_energy(row, extra, guard, lane, own, displacements);
      }
      energies[own] += energy;
    }
}

template class Hyperelastic<NeoHookeanLaw>;
template class Hyperelastic<ReducedPolynomialLaw>;
template class Hyperelastic<ExponentialLaw>;

}  // namespace trocar::dynamics
