#pragma once

// Relaxation of measured tissue (quasi-linear viscoelasticity, Dogan 2011 eq. 1 to 4): of the
// stress S that the bracket of the law would have at once (psi.h), each term k has taken away q_k,
// with
//   dq_k/dt = (g_k S - q_k) / tau_k.
// Steps are exact for a stress that grows evenly during the step:
//   q' = e q + g [(1 - e) S + b (S' - S)],  e = exp(-dt/tau),  b = 1 - (1 - e) tau/dt.
//
// A solver that seeks S' takes b (S' - S) to be zero, an error of g dt/(2 tau) times the change in
// one step (4e-4 of it for liver at 1 ms) that is gone after it: what tissue has forgotten by then
// is a stress that stays the same in the step, and with it the forces on nodes
// (relaxed_stress.h).
//
// Between steps the state is world::RelaxationState. One step costs O(tets).

#include <memory>
#include <vector>

#include "common/base/workers.h"
#include "server/dynamics/groups.h"
#include "server/dynamics/topology.h"
#include "server/world/world.h"

namespace trocar::dynamics {

bool relaxes(const scene::Material& material);

class Relaxation {
 public:
  static constexpr std::size_t kEdges = 6;  // of a tet: ab, ac, ad, bc, bd, cd

  static bool is_needed(const scene::Organ& organ);

  // The topology's organ must outlive it.
  Relaxation(const Topology& topology, const Groups& groups);

  // Tets at nodes in these lanes anew.
  void follow(const Topology& topology, const Groups& groups, std::span<const GroupLanes> lanes);

  // The state is new everywhere.
  void take_state() { is_stale_ = true; }
  // Tissue has been where it is for long. Displacements per slot.
  void settle(const Float4* x, world::RelaxationState& state);
  // Before a step of so many seconds: loads().
  void begin_step(float dt, const world::RelaxationState& state, Workers& workers);
  // After it.
  void end_step(const Float4* x, world::RelaxationState& state, Workers& workers);

  // What has been forgotten: N/m per edge of each tet, along the edge as it is. load_index() of the
  // edge between two corners of a tet; kNoLoad is zero.
  const float* loads() const { return loads_.data(); }
  static std::uint32_t load_index(TetIndex tet, std::size_t corner, std::size_t other);
  static constexpr std::uint32_t kNoLoad = 0;

 private:
  static constexpr std::size_t kBlockLoads = kEdges * kLanes;

  struct Block {
    std::array<SlotLanes, 4> nodes;
    std::array<Vec3Lanes, 3> gradients;  // of b, c and d, 1/m
    std::array<Vec3Lanes, 3> rest;       // columns of the stretch of the rest pose
    Lanes volume;                        // m^3, 0: no tet that relaxes
    std::array<std::uint16_t, kLanes> materials{};
    bool is_uniform = true;
  };
  struct Term {
    Lanes decay, of_before, of_now, ahead;  // e, g (1 - e - b), g b, g (1 - e)
  };
  struct Constants {
    Lanes two_c10;                // Pa
    std::array<Lanes, 4> slopes;  // 2 C20 / C10, 3 C30 / C10, ...
    std::vector<Term> terms;
  };
  struct SymMat;

  void set_lane(const Topology& topology, const Groups& groups, TetIndex tet);
  void set_dt(float dt);
  const Constants& constants_of(const Block& block, Constants& scratch) const;
  static SymMat8 stress_of(const Block& block, const Constants& c, const Float4* x);
  void set_loads(const Block& block, std::size_t index, const SymMat8& forgotten);
  void begin_block(std::size_t index, const world::RelaxationState& state, Constants& scratch);
  void end_block(std::size_t index, const Float4* x, world::RelaxationState& state,
                 Constants& scratch);

  const scene::Organ& organ_;
  const std::size_t terms_;
  std::vector<Block> blocks_;
  std::vector<Constants> constants_;  // per material, as scene::material_at() counts
  float dt_ = 0;
  std::vector<float> loads_;  // [block][edge][tet], after one block of zeros
  bool is_stale_ = true;
  std::vector<std::uint32_t> stale_;  // blocks, unless is_stale_
  std::vector<Constants> scratch_;    // per worker
};

// A world that begins: its tissue has been where it is for long. Measured organs under tension.
void start_relaxed(const scene::Organ& organ, world::World& world);

}  // namespace trocar::dynamics
