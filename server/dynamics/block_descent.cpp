#include "server/dynamics/block_descent.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"

namespace trocar::dynamics {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;
constexpr float kMaxOverRelaxationFewSweeps = 1.3f;

using contact::NodeConstraint;

// Energy of a constraint at displacement x, as gradient and block.
//   tie:        k/2 |x - target|^2
//   half-space: k/2 min(0, g)^2 with gap g = n . (x - target), and a drag
//               c/(2 dt) |T (x - start - tool_motion)|^2 with T = I - n n^T
void add_constraint(const NodeConstraint& c, const Vec3f& x, const Vec3f& start, float inverse_dt,
                    Vec3f& gradient, SymMat3f* block) {
  const Vec3f from_target = x - c.target;
  if (c.kind == NodeConstraint::Kind::Tie) {
    gradient += from_target * c.stiffness;
    if (block) block->add_identity(c.stiffness);
    return;
  }
  const float gap = dot(c.normal, from_target);
  if (gap < 0) {
    gradient += c.normal * (c.stiffness * gap);
    if (block) block->add_outer(c.normal, c.stiffness);
  }
  if (c.drag == 0) return;
  const Vec3f slip = x - start - c.tool_motion;
  const float drag = c.drag * inverse_dt;
  gradient += (slip - c.normal * dot(c.normal, slip)) * drag;
  if (block) {
    block->add_identity(drag);
    block->add_outer(c.normal, -drag);
  }
}

}  // namespace

BlockDescent::BlockDescent(const world::World& world, const SpringNetwork& springs)
    : springs_(springs),
      inertia_(world.node_count()),
      terms_(springs.batch_count()),
      first_constraint_(world.node_count()),
      constraint_stamp_(world.node_count()) {
  residuals_.reserve(world.node_count());
  next_constraint_.reserve(8 * contact::kMaxNodesPerTool);
  reset(world);
}

void BlockDescent::reset(const world::World& world) {
  x_.assign(world.displacements.begin(), world.displacements.end());
  start_.assign(world.displacements.begin(), world.displacements.end());
}

void BlockDescent::link_constraints(const contact::ContactList& contacts) {
  if (++current_ == 0) {
    std::fill(constraint_stamp_.begin(), constraint_stamp_.end(), 0u);
    current_ = 1;
  }
  next_constraint_.resize(contacts.constraints.size());
  for (auto i = static_cast<std::uint32_t>(contacts.constraints.size()); i-- > 0;) {
    const auto& c = contacts.constraints[i];
    if (!c.moves_node) continue;
    const auto node = c.node.value;
    next_constraint_[i] = constraint_stamp_[node] == current_ ? first_constraint_[node] : kNone;
    constraint_stamp_[node] = current_;
    first_constraint_[node] = i;
  }
}

void BlockDescent::prepare_step(std::span<const NodeIndex> nodes, float dt,
                                const world::World& world, std::span<const Vec3f> forces) {
  const float inverse_dt = 1.0f / dt;
  for (const auto node : nodes) {
    const auto n = node.value;
    Inertia& inertia = inertia_[n];
    inertia.inertia = world.masses[n] * inverse_dt * inverse_dt +
                      world.masses[n] * springs_.node_damping_per_s() * inverse_dt;
    inertia.momentum = world.velocities[n] * (world.masses[n] * inverse_dt);
    if (!forces.empty()) inertia.momentum += forces[n];
    inertia.block = springs_.prepare_step(node, start_, inverse_dt, terms_);
    inertia.block.add_identity(inertia.inertia);
    // Starting where inertia alone would lead makes rigid motion exact from the first sweep;
    // starting at rest instead acts as a drag as long as sweeps are few.
    x_[n] += world.velocities[n] * dt;
  }
}

BlockDescent::NodeStep BlockDescent::linearise(const contact::ContactList& contacts, NodeIndex node,
                                               float inverse_dt) const {
  const auto n = node.value;
  const Inertia& inertia = inertia_[n];
  NodeStep step{(x_[n] - start_[n]) * inertia.inertia - inertia.momentum, inertia.block};
  springs_.add_gradient_and_block(node, x_, terms_, step.gradient, step.block);
  if (constraint_stamp_[n] == current_)
    for (auto i = first_constraint_[n]; i != kNone; i = next_constraint_[i])
      add_constraint(contacts.constraints[i], x_[n], start_[n], inverse_dt, step.gradient,
                     &step.block);
  return step;
}

void BlockDescent::finish_step(std::span<const NodeIndex> nodes, float inverse_dt,
                               world::World& world) const {
  for (const auto node : nodes) {
    const auto n = node.value;
    world.velocities[n] = (x_[n] - start_[n]) * inverse_dt;
    world.displacements[n] = x_[n];
  }
}

SolveReport BlockDescent::solve(const contact::ContactList& contacts,
                                std::span<const NodeIndex> active, const SolveSettings& settings,
                                world::World& world, const ExternalLoads& loads) {
  TROCAR_ASSERT(loads.held.size() == loads.held_displacements.size());
  TROCAR_ASSERT(loads.forces.empty() || loads.forces.size() == world.node_count());
  SolveReport report;
  reset(world);
  link_constraints(contacts);
  residuals_.resize(active.size());
  const float inverse_dt = 1.0f / settings.dt;
  prepare_step(active, settings.dt, world, loads.forces);
  prepare_step(loads.held, settings.dt, world, loads.forces);
  for (std::size_t i = 0; i < loads.held.size(); ++i)
    x_[loads.held[i].value] = loads.held_displacements[i];
  float omega = settings.sweeps < 3
                    ? std::min(settings.over_relaxation, kMaxOverRelaxationFewSweeps)
                    : settings.over_relaxation;
  float last_sum = INFINITY;
  const float tolerance = settings.residual_tolerance_n;
  const float sum_tolerance =
      tolerance > 0 ? tolerance * tolerance * static_cast<float>(active.size()) : -1.0f;
  for (std::uint32_t sweep = 0; sweep < settings.sweeps; ++sweep) {
    float sum = 0;
    report.nodes_rejected = 0;
    for (std::size_t i = 0; i < active.size(); ++i) {
      const auto step = linearise(contacts, active[i], inverse_dt);
      const float squared = length_squared(step.gradient);
      const Vec3f dx = solve_positive_definite(step.block, step.gradient) * -omega;
      if (!is_finite(dx) || !std::isfinite(squared)) {
        ++report.nodes_rejected;
        residuals_[i] = 0;
        continue;
      }
      sum += squared;
      residuals_[i] = std::sqrt(squared);
      x_[active[i].value] += dx;
    }
    if (sum > last_sum && omega > 1.0f) {
      omega = 1.0f;
      report.is_stepped_down = true;
    }
    last_sum = sum;
    report.sweeps = sweep + 1;
    if (sum <= sum_tolerance && report.nodes_rejected == 0) break;
  }
  finish_step(active, inverse_dt, world);
  finish_step(loads.held, inverse_dt, world);
  if (!active.empty()) report.residual_n = std::sqrt(last_sum / static_cast<float>(active.size()));
  return report;
}

Vec3f BlockDescent::reaction(const contact::ContactList& contacts, const contact::ToolContact& tool,
                             const world::World& world, float dt) const {
  // The constraint's energy gradient is minus the force on the node, hence the force on the tool.
  Vec3f force;
  for (auto i = tool.begin; i < tool.end; ++i) {
    const auto& c = contacts.constraints[i];
    add_constraint(c, world.displacements[c.node.value], start_[c.node.value], 1.0f / dt, force,
                   nullptr);
  }
  return force;
}

}  // namespace trocar::dynamics
