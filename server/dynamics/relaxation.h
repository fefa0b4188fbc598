#pragma once

// Relaxation of measured tissue (quasi-linear viscoelasticity, Dogan 2011 eq. 1 to 4): of the
// stress S that the bracket of the law would have at once (psi.h), each term k has taken away q_k,
// with
//   dq_k/dt = (g_k S - q_k) / tau_k.
// Steps are exact for a stress that grows evenly during the step:
//   q' = e q + g [(1 - e) S + b (S' - S)],  e = exp(-dt/tau),  b = 1 - (1 - e) tau/dt.
//
// A solver that seeks S' takes b (S' - S) to be zero, an error of g dt/(2 tau) times the change in
// one step (4e-4 of it for liver at 1 ms) that is gone after it: what has relaxed by then is a
// stress that stays the same in the step, and with it the forces on nodes (relaxed_stress.h).
//
// Tets may take turns, and be advanced over as many steps at once, which is as exact; until then
// what they have relaxed acts on as it was. Near what is solved a turn comes in each step, or,
// where the rest is solved roughly, once in kNearTime_s; elsewhere once in kFarTime_s. In 4 ms
// liver relaxes by 0.35 % of its stress at most. A step costs O(tets whose turn it is).
//
// Between steps the state is world::RelaxationState.

#include <memory>
#include <vector>

#include "common/base/workers.h"
#include "server/dynamics/groups.h"
#include "server/dynamics/relaxation_figures.h"
#include "server/dynamics/topology.h"
#include "server/world/world.h"

namespace trocar::dynamics {

bool relaxes(const scene::Material& material);

class Relaxation {
 public:
  static constexpr std::size_t kEdges = 6;  // of a tet: ab, ac, ad, bc, bd, cd
  static constexpr float kNearTime_s = 0.004f, kFarTime_s = 0.008f;

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
  // After it: advances tets at near nodes, each of them or in turns, and others whose turn it is.
  void end_step(const Float4* x, std::span<const GroupLanes> near, bool near_in_turns,
                world::RelaxationState& state, Workers& workers);
  // After follow(), once a step has been begun: their loads.
  void refresh(const world::RelaxationState& state);
  // O(tets / 8).
  RelaxationFigures figures() const;
  // Steps from one turn to the next, near and elsewhere.
  std::uint32_t near_turns() const { return near_turns_; }
  std::uint32_t far_turns() const { return far_turns_; }
  // Whether it is the turn of a block of tets, or group of nodes, in this step of the state.
  static bool is_turn_of(std::size_t index, std::uint32_t turns, std::uint8_t step) {
    return index / kRun % turns == step % turns;
  }

  // Of the stress that has relaxed: N/m per edge of each tet, along the edge as it is. load_index()
  // of the edge between two corners of a tet; kNoLoad is zero.
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
    Lanes decay, of_before, of_now;  // e, g (1 - e - b), g b; over the steps since the last
    Lanes next_decay, ahead;         // e, g (1 - e); over one step
  };
  struct Constants {
    Lanes two_c10, bulk;          // Pa
    std::array<Lanes, 4> slopes;  // 2 C20 / C10, 3 C30 / C10, ...
    Lanes exponent;               // of an exponential law, else 0
    bool is_exponential = false;  // in some lane
    std::vector<Term> terms;
  };

  void set_lane(const Topology& topology, const Groups& groups, TetIndex tet);
  void set_dt(float dt);
  Constants constants_of(const scene::Material& material, std::size_t steps) const;
  const Constants& constants_of(const Block& block, const world::RelaxationState::Steps& age,
                                Constants& scratch) const;
  struct Response {
    SymMat8 stress;                       // Pa
    Float8 energy_density, volume_ratio;  // Pa, 1
  };
  // What a block adds to figures().
  struct BlockFigures {
    float energy_j = 0, volume_m3 = 0, growth_m3 = 0;
    float stress_squared = 0, relaxed = 0;  // volume times stress by stress, by what has relaxed
  };
  static Response response_of(const Block& block, const Constants& c, const Float4* x);
  void set_figures(std::size_t index, const Response& response, const SymMat8& relaxed_stress);
  void set_loads(const Block& block, std::size_t index, const SymMat8& relaxed_stress);
  void begin_block(std::size_t index, const world::RelaxationState& state, Constants& scratch);
  // The hash's difference.
  std::uint64_t end_block(std::size_t index, const Float4* x, world::RelaxationState& state,
                          Constants& scratch);
  void list_blocks_of(const Topology& topology, const Groups& groups, Slot slot);
  void list_due(std::span<const GroupLanes> near, std::uint32_t near_turns, std::uint8_t step);

  const scene::Organ& organ_;
  const std::size_t terms_;
  std::vector<Block> blocks_;
  std::vector<BlockFigures> figures_;
  // Longest time that a tet can wait, in steps: its turn, and once more where a part of a tet that
  // was cut came to be among others.
  static constexpr std::size_t kMostSteps = 16;
  static constexpr std::uint32_t kRun = 4;  // blocks, or groups, whose turn comes together
  std::vector<Constants> constants_;        // [steps - 1][material as scene::material_at() counts]
  float dt_ = 0;
  std::uint32_t near_turns_ = 1, far_turns_ = 1;
  std::vector<std::vector<std::uint32_t>> blocks_of_;  // per slot: of tets at its node
  std::vector<std::uint32_t> due_, due_stamp_;         // blocks; per block
  std::uint32_t current_ = 0;
  std::vector<float> loads_;  // [block][edge][tet], after one block of zeros
  bool is_stale_ = true;
  std::vector<std::uint32_t> stale_;  // blocks, unless is_stale_
  std::vector<TetIndex> tets_;        // while it follows
  std::vector<Constants> scratch_;    // per worker
  std::vector<std::uint64_t> differences_;
};

}  // namespace trocar::dynamics
