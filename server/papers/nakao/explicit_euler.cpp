#include "server/papers/nakao/explicit_euler.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"

namespace trocar::nakao {

using namespace dynamics;

namespace {

constexpr int kPowerIterations = 300;
// Displacement at which stiffness is measured, m: far above float rounding, far below an edge.
constexpr double kProbe_m = 1e-5;
// Power iteration comes from below.
constexpr double kSafety = 0.97;

}  // namespace

ExplicitEuler::ExplicitEuler(const organ::Organ& organ, const world::World& world)
    : organ_(organ),
      tissue_(organ),
      masses_(world.masses),
      x_(tissue_.groups().slot_count()),
      start_(x_.size()) {
  const auto map = organ::material_map(organ);
  double longest_time = 0, highest_rate = 0;
  for (std::uint32_t n = 0; n < world.node_count(); ++n) {
    const auto& material = organ::material_at(organ, map.nodes[n]);
    damping_rates_.push_back(static_cast<float>(material.node_damping_per_s));
    is_free_.push_back(world.node_classes[n] != world::NodeClass::Fixed);
    longest_time = std::max(longest_time, material.edge_damping_time_s);
    highest_rate = std::max(highest_rate, material.node_damping_per_s);
  }
  highest_frequency_ = find_highest_frequency();
  const double w2 = highest_frequency_ * highest_frequency_;
  if (!(w2 > 0)) {
    stable_dt_s_ = 1;
    return;
  }
  const double c = highest_rate + longest_time * w2;
  stable_dt_s_ = kSafety * (std::sqrt(c * c + 4 * w2) - c) / w2;
}

std::vector<Vec3f> ExplicitEuler::gradients(std::span<const Float4> x) {
  const auto& groups = tissue_.groups();
  std::vector<Vec3f> result(masses_.size());
  if (auto* const strain = tissue_.nodal_strain())
    for (Group g = 0; g < groups.group_count(); ++g) strain->restart_group(g, x.data());
  for (Group g = 0; g < groups.group_count(); ++g) {
    NodeStep8 step{zero_vec8(), zero_sym_mat8()};
    tissue_.add(g, x.data(), load_group(x.data() + g * kLanes), step);
    Vec3Lanes gradient;
    store(gradient, step.gradient);
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      if (const auto node = groups.nodes_of(g)[lane]; node.is_valid())
        result[node.value] = gradient.at(lane);
  }
  return result;
}

double ExplicitEuler::find_highest_frequency() {
  const auto& groups = tissue_.groups();
  const auto count = static_cast<std::uint32_t>(masses_.size());
  for (Group g = 0; g < groups.group_count(); ++g) tissue_.begin_group(g, x_.data(), 0);
  const auto at_rest = gradients(std::vector<Float4>(x_.size()));
  // Any start that is not smooth has a share in the stiffest mode.
  std::vector<Vec3d> v(count);
  for (std::uint32_t n = 0; n < count; ++n)
    if (is_free_[n])
      v[n] = {double(n * 7919 % 101) - 50, double(n * 104729 % 103) - 51, double(n * 31 % 97) - 48};
  double w2 = 0;
  for (int i = 0; i < kPowerIterations; ++i) {
    double largest = 0;
    for (const auto& a : v) largest = std::max(largest, length(a));
    if (!(largest > 0)) return 0;
    double before = 0, after = 0;
    for (std::uint32_t n = 0; n < count; ++n) {
      v[n] *= kProbe_m / largest;
      before += static_cast<double>(masses_[n]) * length_squared(v[n]);
      x_[groups.slot_of(NodeIndex(n))] = to_float4(to_float(v[n]));
    }
    const auto moved = gradients(x_);
    for (std::uint32_t n = 0; n < count; ++n) {
      if (!is_free_[n]) continue;
      v[n] = to_double(moved[n] - at_rest[n]) / static_cast<double>(masses_[n]);
      after += static_cast<double>(masses_[n]) * length_squared(v[n]);
    }
    w2 = std::sqrt(after / before);
  }
  return std::sqrt(w2);
}

void ExplicitEuler::step(double dt, world::World& world, const ExternalLoads& loads) {
  TROCAR_ASSERT(dt > 0 && dt <= stable_dt_s_);
  const auto& groups = tissue_.groups();
  const auto h = static_cast<float>(dt);
  const Vec3f gravity = to_float(organ_.gravity_m_s2);
  // A dashpot's force follows from lengths now and where velocities say they were.
  for (std::uint32_t n = 0; n < masses_.size(); ++n) {
    const Slot slot = groups.slot_of(NodeIndex(n));
    x_[slot] = to_float4(world.displacements[n]);
    start_[slot] = to_float4(world.displacements[n] - world.velocities[n] * h);
  }
  for (Group g = 0; g < groups.group_count(); ++g) tissue_.begin_group(g, start_.data(), 1.0f / h);
  const auto gradient = gradients(x_);
  for (std::uint32_t n = 0; n < masses_.size(); ++n) {
    if (!is_free_[n]) continue;
    Vec3f force = gravity * masses_[n] - gradient[n];
    if (!loads.forces.empty()) force += loads.forces[n];
    Vec3f& v = world.velocities[n];
    v += (force / masses_[n] - v * damping_rates_[n]) * h;
    world.displacements[n] += v * h;
  }
  for (std::size_t i = 0; i < loads.held.size(); ++i) {
    const auto n = loads.held[i].value;
    world.velocities[n] = (loads.held_displacements[i] - world.displacements[n]) / h;
    world.displacements[n] = loads.held_displacements[i];
  }
}

}  // namespace trocar::nakao
