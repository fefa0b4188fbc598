#pragma once

// Implicit Euler by block descent (vertex block descent, Chen et al. 2024): for each node in turn
// one Newton step on the node's own 3x3 block of the incremental potential
//   sum_i m_i/(2 dt^2) |x_i - u_i - dt v_i|^2 + springs + damping + contacts,
// several sweeps per step, over-relaxed. Over-relaxation is stepped down to 1 for the rest of the
// tick when a sweep's residual grew against the sweep before. Plain scalar form in the order of the
// active set. Order was measured to be irrelevant to convergence. O(sweeps x active nodes x springs
// per node); no allocation after construction.

#include <span>
#include <vector>

#include "common/base/index.h"
#include "server/contact/contact_list.h"
#include "server/dynamics/spring_network.h"
#include "server/world/world.h"

namespace trocar::dynamics {

struct SolveSettings {
  std::uint32_t sweeps = 4;
  float over_relaxation = 1.5f;  // below three sweeps at most 1.3 is used: more overshoots
  float dt = 1e-3f;              // s
  // Sweeping ends before `sweeps` when a sweep's residual is at most this; 0: never.
  float residual_tolerance_n = 0;
};

// What acts from outside besides tools. Default: nothing.
struct ExternalLoads {
  std::span<const Vec3f> forces;  // N, per node of the organ; empty: none
  // Nodes put where `held_displacements` says at the end of the step, with whatever force that
  // takes (holding_force). None of them is active.
  std::span<const NodeIndex> held;
  std::span<const Vec3f> held_displacements;  // m, per entry of `held`
};

struct SolveReport {
  float residual_n = 0;  // root mean square over active nodes, last sweep, before each node's step
  bool is_stepped_down = false;
  std::uint32_t nodes_rejected = 0;  // their step was not finite
  std::uint32_t sweeps = 0;          // done
};

class BlockDescent {
 public:
  BlockDescent(const world::World& world, const SpringNetwork& springs);

  // Advances displacements and velocities of `active` nodes by one step; all other nodes stay.
  SolveReport solve(const contact::ContactList& contacts, std::span<const NodeIndex> active,
                    const SolveSettings& settings, world::World& world,
                    const ExternalLoads& loads = {});

  // Force imbalance per entry of `active` in the last sweep, N.
  std::span<const float> residuals_n() const { return residuals_; }

  // Force of the tissue on each tool, N, per entry of contacts.tools, from the state just solved.
  // `start` of the drag is the state before the solve, which is kept from it.
  Vec3f reaction(const contact::ContactList& contacts, const contact::ToolContact& tool,
                 const world::World& world, float dt) const;

  // Force on a node of the last solve's loads.held that put it where it is, N: what springs,
  // damping, loads and tools leave of its mass times acceleration.
  Vec3f holding_force(const contact::ContactList& contacts, NodeIndex node, float dt) const {
    return linearise(contacts, node, 1.0f / dt).gradient;
  }

 private:
  struct NodeStep {
    Vec3f gradient;
    SymMat3f block;
  };
  void reset(const world::World& world);
  void link_constraints(const contact::ContactList& contacts);
  NodeStep linearise(const contact::ContactList& contacts, NodeIndex node, float inverse_dt) const;
  void prepare_step(std::span<const NodeIndex> nodes, float dt, const world::World& world,
                    std::span<const Vec3f> forces);
  void finish_step(std::span<const NodeIndex> nodes, float inverse_dt, world::World& world) const;

  const SpringNetwork& springs_;
  // Inertia and damping of a node, constant in a step: the gradient is
  // inertia (x - start) - momentum, plus the springs' damping.
  struct Inertia {
    SymMat3f block;
    float inertia = 0;  // m/dt^2 + rate m/dt, N/m
    Vec3f momentum;     // m/dt v and loads, N
  };
  std::vector<Inertia> inertia_;                 // per node, valid for active ones
  std::vector<SpringNetwork::StepTerms> terms_;  // per spring batch, likewise
  std::vector<Vec3f> x_;                         // displacements being solved
  std::vector<Vec3f> start_;                     // displacements at the start of the step
  std::vector<float> residuals_;
  // Constraints of a node as a linked list in contact order; valid where the stamp is current.
  std::vector<std::uint32_t> first_constraint_, constraint_stamp_, next_constraint_;
  std::uint32_t current_ = 0;
};

}  // namespace trocar::dynamics
