#include "server/tissue/dynamics/ties.h"

#include <algorithm>
#include <cmath>

namespace trocar::dynamics {
namespace {

// Squares of lengths at or below this have no direction.
constexpr float kLeastLengthSquared = 1e-18f;

}  // namespace

Ties::Ties(const topology::Topology& topology, const Groups& groups) {
  rows_.reserve(groups, [&](NodeIndex node) { return topology.ties().at(node).size(); });
  for (Group g = 0; g < groups.group_count(); ++g) fill(topology, groups, {g, 0xff});
  rows_.end_building();
}

std::size_t Ties::fill(const topology::Topology& topology, const Groups& groups, GroupLanes lanes) {
  const auto& net = topology.ties();
  const auto nodes = groups.nodes_of(lanes.group);
  std::array<std::uint32_t, kLanes> counts{};
  std::size_t written = 0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    if (!lanes.has(lane) || !nodes[lane].is_valid()) continue;
    counts[lane] = static_cast<std::uint32_t>(net.at(nodes[lane]).size());
    written += counts[lane];
  }
  const auto rows = rows_.reshape(lanes, counts);
  for (std::size_t lane = 0; lane < kLanes; ++lane)
    for (std::size_t i = 0; i < counts[lane]; ++i) {
      const auto number = net.at(nodes[lane])[i];
      const auto& tie = net[number];
      const auto& first = tie.ends[0].nodes;
      const bool is_first = std::ranges::find(first, nodes[lane]) != first.end();
      const auto &own = tie.ends[is_first ? 0 : 1], &other = tie.ends[is_first ? 1 : 0];
      Row& row = rows[i];
      std::size_t beside = 0;
      for (std::size_t k = 0; k < kAcross; ++k) {
        const auto weight = static_cast<float>(own.weights[k]);
        if (own.nodes[k] == nodes[lane]) {
          row.weight.v[lane] = weight;
        } else {
          row.beside[beside].v[lane] = groups.slot_of(own.nodes[k]);
          row.beside_weights[beside++].v[lane] = weight;
        }
        row.across[k].v[lane] = groups.slot_of(other.nodes[k]);
        row.across_weights[k].v[lane] = static_cast<float>(other.weights[k]);
      }
      const double peak = tie.area_m2 * tie.law->strength_pa;
      row.tie.v[lane] = number;
      row.rest.set(lane, to_float(other.place_m - own.place_m));
      row.rest_length.v[lane] = static_cast<float>(tie.rest_length_m);
      row.slope.v[lane] = static_cast<float>(peak / tie.law->rise_m);
      row.fall.v[lane] = static_cast<float>(peak / (tie.law->full_m() - tie.law->rise_m));
      row.full.v[lane] = static_cast<float>(tie.law->full_m());
      row.most.v[lane] = extensions_ != nullptr ? extensions_[number] : 0;
    }
  return written;
}

std::size_t Ties::rebuild(const topology::Topology& topology, const Groups& groups,
                          std::span<const GroupLanes> lanes) {
  rows_.extend(groups);
  std::size_t written = 0;
  for (const auto group_lanes : lanes) written += fill(topology, groups, group_lanes);
  rows_.tidy();
  return written;
}

void Ties::begin_group(Group group, const Float4*, const Vec8&, float) {
  if (extensions_ == nullptr) return;
  for (Row& row : rows_[group]) store(row.most, gather(extensions_, row.tie));
}

void Ties::add(Group group, const Float4* x, const Vec8& own, NodeStep8& step) const {
  // Sums live in registers: in `step` they would be stored and loaded again row after row.
  Vec8 pull = zero_vec8();
  SymMat8 block = step.block;
  Float8 identity = all(0);
  for (const Row& row : rows_[group]) {
    const Float8 weight = load(row.weight);
    Vec8 r = load(row.rest);
    for (std::size_t k = 0; k < kAcross; ++k)
      r = fma8(gather(x, row.across[k]), load(row.across_weights[k]), r);
    r = r - own * weight;
    for (std::size_t k = 0; k < kBeside; ++k)
      r = r - gather(x, row.beside[k]) * load(row.beside_weights[k]);
    const Float8 squared = dot8(r, r);
    const Float8 is_long = _mm256_cmp_ps(squared, all(kLeastLengthSquared), _CMP_GT_OQ);
    const Float8 inverse = where(is_long, all(1.0f) / _mm256_sqrt_ps(squared));
    const Float8 rest_length = load(row.rest_length);
    const Float8 d = fma8(squared, inverse, all(0) - rest_length);
    const Float8 is_pulled = _mm256_cmp_ps(d, all(0), _CMP_GT_OQ);
    const Float8 m = _mm256_max_ps(d, load(row.most));
    const Float8 tension = _mm256_max_ps(
        all(0), _mm256_min_ps(load(row.slope) * m, load(row.fall) * (load(row.full) - m)));
    const Float8 secant = where(is_pulled, tension / m);
    const Float8 over_length = secant * d * inverse;
    const Float8 squared_weight = weight * weight;
    pull = fma8(r, weight * over_length, pull);
    identity = fma8(squared_weight, over_length, identity);
    block.add_outer(r, squared_weight * (secant * rest_length) * (inverse * inverse * inverse));
  }
  step.gradient = step.gradient - pull;
  block.add_identity(identity);
  step.block = block;
}

void Ties::add_energies_j(std::span<const Vec3d> displacements, std::span<double> energies) const {
  // A tie is stored at each of its nodes: a node has the half of its weight of it.
  for (Group g = 0; g < rows_.group_count(); ++g)
    for (const Row& row : rows_[g])
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const auto at = [lane](const Lanes& lanes) { return static_cast<double>(lanes.v[lane]); };
        Vec3d r = to_double(row.rest.at(lane)) - displacements[g * kLanes + lane] * at(row.weight);
        for (std::size_t k = 0; k < kAcross; ++k)
          r += displacements[row.across[k].v[lane]] * at(row.across_weights[k]);
        for (std::size_t k = 0; k < kBeside; ++k)
          r -= displacements[row.beside[k].v[lane]] * at(row.beside_weights[k]);
        const double d = length(r) - at(row.rest_length);
        if (!(d > 0) || !(at(row.slope) > 0)) continue;
        const double slope = at(row.slope), fall = at(row.fall), full = at(row.full);
        // Work from nothing to an extension that is pulled for the first time.
        const double rise = fall * full / (slope + fall);
        const auto first_work = [&](double m) {
          const double left = std::max(0.0, full - m);
          return m <= rise ? 0.5 * slope * m * m : 0.5 * (slope * rise * full - fall * left * left);
        };
        const double m = at(row.most);
        const double tension = std::max(0.0, std::min(slope * m, fall * (full - m)));
        const double energy =
            d <= m ? 0.5 * tension / m * d * d : 0.5 * tension * m + first_work(d) - first_work(m);
        energies[g * kLanes + lane] += 0.5 * at(row.weight) * energy;
      }
}

}  // namespace trocar::dynamics
