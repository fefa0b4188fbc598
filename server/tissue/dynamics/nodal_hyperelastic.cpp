#include "server/tissue/dynamics/nodal_hyperelastic.h"

namespace trocar::dynamics {
namespace {

// A domain that has less than this share of its volume begins to fold, or is folded.
constexpr float kFoldsFrom = 0.4f, kIsFolded = 0.2f;
// One with this I1 begins to be drawn out, threefold, or is, fourfold. The inertia that its
// stiffness asks for may be hundreds of times its mass: it would fly on, whatever pulls it back.
constexpr float kDrawnFrom = 9, kIsDrawn = 18;

// Returns 0 up to `from`, 1 from `until` on.
Float8 share(Float8 value, float from, float until) {
  return _mm256_max_ps(_mm256_min_ps((value - all(from)) * all(1 / (until - from)), all(1)),
                       all(0));
}

}  // namespace

template <typename Law>
NodalHyperelastic<Law>::NodalHyperelastic(const topology::Topology& topology, const Groups& groups,
                                          const NodalStrain& strain,
                                          const HyperelasticParameters& of_law, const Law& law)
    : nodal_strain_(strain), law_(law) {
  for (std::size_t m = 0; m < of_law.size(); ++m) {
    const auto& material = organ::material_at(topology.organ(), static_cast<std::uint16_t>(m));
    is_of_law_.push_back(of_law[m].has_value());
    has_others_ |=
        !of_law[m] && material::is_hyperelastic(material) && material.has_averaged_strain;
  }
  if (!has_others_) return;
  is_own_.resize(3 * groups.slot_count());
  for (Slot slot = 0; slot < groups.slot_count(); ++slot) set(groups, slot);
}

template <typename Law>
void NodalHyperelastic<Law>::set(const Groups& groups, Slot slot) {
  const auto node = groups.node_at(slot);
  const auto material = node.is_valid() ? nodal_strain_.material_of(node) : NodalStrain::kNone;
  is_own_[3 * slot] = material != NodalStrain::kNone && is_of_law_[material] ? 1.0f : 0.0f;
}

template <typename Law>
void NodalHyperelastic<Law>::rebuild(const Groups& groups, std::span<const GroupLanes> lanes) {
  if (!has_others_) return;
  is_own_.resize(3 * groups.slot_count());
  for (const auto group_lanes : lanes)
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      if (group_lanes.has(lane)) set(groups, static_cast<Slot>(group_lanes.group * kLanes + lane));
}

template <typename Law>
void NodalHyperelastic<Law>::add(Group group, NodeStep8& step) const {
  // Sums live in registers: in `step` they would be stored and loaded again row after row.
  Vec8 gradient = step.gradient;
  SymMat8 block = step.block;
  Float8 identity = all(0);
  for (const auto& row : nodal_strain_.rows(group)) {
    const auto f = nodal_strain_.gradient_at(row.domain);
    const auto& [f0, f1, f2] = f.rows;
    Vec8 b = load(row.part);
    if (has_others_) b = b * gather(is_own_.data(), row.domain);
    const Vec8 k0 = cross8(f1, f2), k1 = cross8(f2, f0), k2 = cross8(f0, f1);  // cofactors
    const Vec8 fb{dot8(f0, b), dot8(f1, b), dot8(f2, b)};
    const Vec8 kb{dot8(k0, b), dot8(k1, b), dot8(k2, b)};
    const Float8 pressure = fma8(f.bulk, dot8(f0, k0) - all(1), all(0) - f.two_c10);
    gradient = fma8(kb, pressure, gradient);
    block.add_outer(kb, f.bulk * f.inverse_volume);
    const Float8 squared = dot8(b, b) * f.inverse_volume;
    if constexpr (Law::kIsLinear) {
      gradient = fma8(fb, f.two_c10, gradient);
      identity = fma8(squared, f.two_c10, identity);
    } else {
      const Float8 i1 = dot8(f0, f0) + (dot8(f1, f1) + dot8(f2, f2));
      Float8 first, second;
      law_.derivatives(i1 - all(3), first, second);
      first = first * f.two_c10;
      gradient = fma8(fb, first, gradient);
      identity = fma8(squared, first, identity);
      block.add_outer(fb, second * f.two_c10 * (f.inverse_volume + f.inverse_volume));
    }
  }
  block.add_identity(identity);
  step = {gradient, block};
}

template <typename Law>
void NodalHyperelastic<Law>::add_stress(Group group, const NodalStrain::Gradient& f,
                                        NodalStress8& stress) const {
  Float8 two_c10 = f.two_c10, bulk = f.bulk;
  if (has_others_) {
    Lanes own;
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      own.v[lane] = is_own_[NodalStrain::kRows * (group * kLanes + lane)];
    two_c10 = two_c10 * load(own), bulk = bulk * load(own);
  }
  const auto& [f0, f1, f2] = f.rows;
  const Vec8 k0 = cross8(f1, f2), k1 = cross8(f2, f0), k2 = cross8(f0, f1);  // cofactors
  const Float8 volume_ratio = dot8(f0, k0);
  const Float8 pressure = fma8(bulk, volume_ratio - all(1), all(0) - two_c10);
  Float8 shear = two_c10, stiff = two_c10;
  if constexpr (!Law::kIsLinear) {
    const Float8 i1 = dot8(f0, f0) + (dot8(f1, f1) + dot8(f2, f2));
    Float8 first, second;
    law_.derivatives(i1 - all(3), first, second);
    shear = two_c10 * first;
    stiff = two_c10 * fma8(second + second, i1, first);
  }
  stress.rows[0] = stress.rows[0] + fma8(k0, pressure, f0 * shear);
  stress.rows[1] = stress.rows[1] + fma8(k1, pressure, f1 * shear);
  stress.rows[2] = stress.rows[2] + fma8(k2, pressure, f2 * shear);
  // The largest sum of a row bounds the eigenvalues of the cofactors' products.
  const Float8 k01 = abs8(dot8(k0, k1)), k02 = abs8(dot8(k0, k2)), k12 = abs8(dot8(k1, k2));
  const Float8 largest =
      _mm256_max_ps(dot8(k0, k0) + (k01 + k02),
                    _mm256_max_ps(dot8(k1, k1) + (k01 + k12), dot8(k2, k2) + (k02 + k12)));
  const Float8 bound = fma8(bulk, largest, stiff) * f.inverse_volume;
  stress.stiffness = stress.stiffness + bound;
  const Float8 squared = dot8(f0, f0) + (dot8(f1, f1) + dot8(f2, f2));
  const Float8 is_extreme = _mm256_max_ps(share(volume_ratio, kFoldsFrom, kIsFolded),
                                          share(squared, kDrawnFrom, kIsDrawn));
  if (_mm256_movemask_ps(_mm256_cmp_ps(is_extreme, all(0), _CMP_GT_OQ)) == 0) return;
  // The volume's second derivative is no larger than the gradient.
  const Float8 geometric = abs8(pressure) * _mm256_sqrt_ps(squared) * f.inverse_volume;
  stress.drag = fma8(is_extreme, bound + geometric, stress.drag);
}

template <typename Law>
void NodalHyperelastic<Law>::add_energies_j(std::span<const Vec3d> displacements,
                                            std::span<double> energies) const {
  for (Slot own = 0; own < nodal_strain_.slot_count(); ++own) {
    const NodalStrain::Domain& rest = nodal_strain_.at_rest(own);
    if (rest[0].w == 0 || (has_others_ && is_own_[3 * own] == 0)) continue;
    std::array<Vec3d, 3> f;
    for (std::size_t r = 0; r < 3; ++r) f[r] = to_double(to_vec3(rest[r]));
    for (const auto& member : nodal_strain_.members(own / kLanes)) {
      const std::size_t lane = own % kLanes;
      const Vec3d u = displacements[member.node.v[lane]] - displacements[own];
      const Vec3d b = to_double(member.part.at(lane));
      f[0] += b * u.x, f[1] += b * u.y, f[2] += b * u.z;
    }
    const double inverse_volume = static_cast<double>(rest[0].w);
    for (auto& row : f) row = row * inverse_volume;
    f[0].x += 1, f[1].y += 1, f[2].z += 1;
    const double growth = dot(f[0], cross(f[1], f[2])) - 1;
    const double e = length_squared(f[0]) + length_squared(f[1]) + length_squared(f[2]) - 3;
    double psi = e;  // over C10
    if constexpr (!Law::kIsLinear) psi = law_.energy(e);
    const auto two_c10 = static_cast<double>(rest[1].w), bulk = static_cast<double>(rest[2].w);
    energies[own] += (two_c10 * (psi / 2 - growth) + bulk / 2 * growth * growth) / inverse_volume;
  }
}

template class NodalHyperelastic<NeoHookeanLaw>;
template class NodalHyperelastic<ReducedPolynomialLaw>;
template class NodalHyperelastic<ExponentialLaw>;

}  // namespace trocar::dynamics
