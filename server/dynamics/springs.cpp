#include "server/dynamics/springs.h"

#include <cmath>

namespace trocar::dynamics {
namespace {

// Squares of lengths at or below this have no direction.
constexpr float kMinLengthSquared = 1e-18f;

Float8 inverse_length(Float8 length_squared) {
  const Float8 is_long = _mm256_cmp_ps(length_squared, all(kMinLengthSquared), _CMP_GT_OQ);
  return where(is_long, all(1.0f) / _mm256_sqrt_ps(length_squared));
}

}  // namespace

Springs::Springs(const scene::Organ& organ, const Groups& groups) {
  const auto springs = scene::springs_of(organ);
  const auto& pairs = organ.mesh.spring_pairs();
  const auto& positions = organ.mesh.rest_positions;
  std::vector<std::vector<std::uint32_t>> springs_at(organ.mesh.node_count());
  std::vector<std::uint32_t> counts(organ.mesh.node_count());
  for (std::uint32_t s = 0; s < pairs.size(); ++s) {
    if (springs[s].stiffness_n_m == 0 && springs[s].damping_n_s_m == 0) continue;
    has_any_ = true;
    has_damping_ = has_damping_ || springs[s].damping_n_s_m > 0;
    for (const auto node : pairs[s]) {
      springs_at[node.value].push_back(s);
      ++counts[node.value];
    }
  }
  rows_ = make_rows<Row>(
      groups, counts, [&](Row& row, std::size_t lane, NodeIndex node, std::uint32_t i) {
        const auto s = springs_at[node.value][i];
        const auto other = pairs[s][0] == node ? pairs[s][1] : pairs[s][0];
        row.neighbour.v[lane] = groups.slot_of(other);
        row.rest.set(lane, to_float(positions[other.value] - positions[node.value]));
        row.stiffness.v[lane] = static_cast<float>(springs[s].stiffness_n_m);
        row.pull.v[lane] = static_cast<float>(springs[s].stiffness_n_m * springs[s].rest_length_m);
      });
  constants_ = make_rows<Constants>(
      groups, counts, [&](Constants& row, std::size_t lane, NodeIndex node, std::uint32_t i) {
        const auto& spring = springs[springs_at[node.value][i]];
        row.stiffness.v[lane] = static_cast<float>(spring.stiffness_n_m);
        row.damping.v[lane] = static_cast<float>(spring.damping_n_s_m);
        row.rest_length.v[lane] = static_cast<float>(spring.rest_length_m);
      });
}

void Springs::begin_step(float inverse_dt) {
  if (!has_damping_ || inverse_dt == inverse_dt_) return;
  inverse_dt_ = inverse_dt;
  for (std::size_t i = 0; i < rows_.rows.size(); ++i) {
    const Constants& c = constants_.rows[i];
    store(rows_.rows[i].stiffness, fma8(load(c.damping), all(inverse_dt), load(c.stiffness)));
    store(rows_.rows[i].pull, load(c.stiffness) * load(c.rest_length));
  }
}

void Springs::begin_group(Group group, const Float4* start) {
  if (!has_damping_ || inverse_dt_ == 0) return;
  const Vec8 own = load_group(start + group * kLanes);
  auto constants = constants_[group].begin();
  for (Row& row : rows_[group]) {
    const Constants& c = *constants++;
    const Vec8 r = load(row.rest) + (gather(start, row.neighbour) - own);
    const Float8 length = _mm256_sqrt_ps(dot8(r, r));
    store(row.pull, fma8(load(c.damping) * all(inverse_dt_), length,
                         load(c.stiffness) * load(c.rest_length)));
  }
}

void Springs::add(Group group, const Float4* x, const Vec8& own, NodeStep8& step, Scratch&) const {
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

double Springs::energy_j(std::span<const Vec3d> displacements) const {
  double twice = 0;  // every spring is stored at both ends
  for (Group g = 0; g + 1 < rows_.offsets.size(); ++g)
    for (std::size_t i = 0; i < rows_[g].size(); ++i)
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const Row& row = rows_[g][i];
        const Constants& c = constants_[g][i];
        const Vec3d r = to_double(row.rest.at(lane)) + displacements[row.neighbour.v[lane]] -
                        displacements[g * kLanes + lane];
        const double stretch = length(r) - static_cast<double>(c.rest_length.v[lane]);
        twice += 0.5 * static_cast<double>(c.stiffness.v[lane]) * stretch * stretch;
      }
  return 0.5 * twice;
}

}  // namespace trocar::dynamics
