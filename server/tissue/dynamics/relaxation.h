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
// Tets take turns, and are advanced over as many steps at once, which is as exact. Between two
// turns acts what will have relaxed on average in that time if the stress stays as it is: with T
// steps from turn to turn, (T + 1)/2 steps later where forces are taken in each step, T later where
// nodes take them in turns of their own and keep them. Over nodes and turns, tissue that is held
// then has the force it should; a single force is off by T/2 steps at most, or by T. A turn comes
// once in kTurn_s, or in each step near what is solved where nothing is solved roughly. In 8 ms
// liver relaxes by 0.7 % of its stress at most. A step costs O(tets whose turn it is).
//
// NodalStrain, where strain is averaged, relax as tets do (nodal_relaxation.h). Between steps the
// state is world::RelaxationState.

#include <immintrin.h>

#include <memory>
#include <vector>

#include "common/base/stamps.h"
#include "common/base/workers.h"
#include "common/wire/figures.h"
#include "server/tissue/dynamics/nodal_relaxation.h"
#include "server/tissue/dynamics/strain_scheme.h"
#include "server/tissue/world/world.h"

namespace trocar::dynamics {

using wire::RelaxationFigures;

class Relaxation {
 public:
  static constexpr std::size_t kCorners = 4;
  static constexpr float kTurn_s = 0.008f;

  static bool is_needed(const organ::Organ& organ);

  // The topology's organ and the smoothing domains must outlive it. NodalStrain: null if nothing is
  // averaged; they are to be where the tissue is in settle() and end_step().
  Relaxation(const topology::Topology& topology, const Groups& groups, const NodalStrain* strain,
             StrainScheme scheme);

  // Tets and smoothing domains at nodes in these lanes anew; with smoothing domains, lanes as for
  // NodalStrain::rebuild().
  void update(const topology::Topology& topology, const Groups& groups,
              std::span<const GroupLanes> lanes);

  // The state is new everywhere.
  void restart() { is_stale_ = true; }
  // Tissue has been where it is for long. Displacements per slot.
  void settle(const Float4* x, world::RelaxationState& state);
  // Before a step of so many seconds: loads().
  void begin_step(float dt, const world::RelaxationState& state, Workers& workers);
  // After it: advances tets at these nodes, and others whose turn it is.
  void end_step(const Float4* x, std::span<const GroupLanes> nodes, world::RelaxationState& state,
                Workers& workers);
  // After update(), once a step has been begun: their loads.
  void refresh(const world::RelaxationState& state);
  // O(tets / 8).
  RelaxationFigures figures() const;
  // Whether it is the turn of a block of tets, or group of nodes, in this step of the state.
  bool is_turn_of(std::size_t index, std::uint8_t step) const {
    return index / kRun % turns_ == step % turns_;
  }

  // The loads of relaxed stress on a tet's edges, N/m, along the edge as it is: ab, ac, ad, bc, bd,
  // cd, and two zeros.
  using Loads = Lanes;
  static_assert(kLanes == 8);
  // Returns those of all tets, to be read by loads_of_corner(). Those at kNoLoads are zero.
  const Loads* loads() const { return loads_.data(); }
  static std::uint32_t loads_index(TetIndex tet, std::size_t corner) {
    return static_cast<std::uint32_t>((tet.value + 1) * kCorners + corner);
  }
  static constexpr std::uint32_t kNoLoads = 0;
  // Returns the loads at loads_index() from its corner c to corners c + 1, c + 2 and c + 3,
  // modulo 4.
  static __m128 loads_of_corner(const Loads* loads, std::uint32_t index) {
    alignas(32) static constexpr std::int32_t kPlaces[kCorners][kLanes] = {
        {0, 1, 2, 6}, {3, 4, 0, 6}, {5, 1, 3, 6}, {2, 4, 5, 6}};
    const __m256i places =
        _mm256_load_si256(reinterpret_cast<const __m256i*>(kPlaces[index % kCorners]));
    return _mm256_castps256_ps128(_mm256_permutevar8x32_ps(load(loads[index / kCorners]), places));
  }
  static void prefetch(const Loads* loads, std::uint32_t index) {
    _mm_prefetch(reinterpret_cast<const char*>(loads + index / kCorners), _MM_HINT_T0);
  }
  // Returns the relaxation of smoothing domains; null if none relaxes.
  const NodalRelaxation* nodal() const { return nodal_relaxation_.get(); }

 private:
  struct Block {
    std::array<SlotLanes, 4> nodes;
    std::array<Vec3Lanes, 3> gradients;  // of b, c and d, 1/m
    std::array<Vec3Lanes, 3> rest;       // columns of the stretch of the rest pose
    Lanes volume;                        // m^3, 0: no tet that relaxes
    Lanes bracket, volumetric;           // shares of it that are not of smoothing domains
    LaneMaterials materials;
  };

  void set_lane(const topology::Topology& topology, const Groups& groups, TetIndex tet);
  void set_dt(float dt);
  static RelaxationTerms::Response response_of(const Block& block,
                                               const RelaxationTerms::Constants& c,
                                               const Float4* x);
  void set_shares(std::size_t index, const RelaxationTerms::Response& response,
                  const SymMat8& relaxed_stress);
  void set_loads(const Block& block, std::size_t index, const SymMat8& relaxed_stress);
  // A share of the blocks: that of worker w of so many.
  void begin_all(const world::RelaxationState& state, Workers& workers);
  void begin_block(std::size_t index, const world::StressHistory& history,
                   RelaxationTerms::Constants& scratch);
  // The hash's difference.
  std::uint64_t end_block(std::size_t index, const Float4* x, world::StressHistory& history,
                          RelaxationTerms::Constants& scratch);
  void list_blocks_of(const topology::Topology& topology, const Groups& groups, Slot slot);
  void list_due(std::span<const GroupLanes> nodes, std::uint8_t step);

  const organ::Organ& organ_;
  const NodalStrain* const nodal_strain_;
  RelaxationTerms terms_, nodal_terms_;
  std::unique_ptr<NodalRelaxation> nodal_relaxation_;
  std::vector<Block> blocks_;
  std::vector<RelaxationShares> shares_;
  static constexpr std::uint32_t kRun = 4;  // blocks, or groups, whose turn comes together
  std::uint32_t turns_ = 1;                 // steps from one turn to the next
  std::vector<std::vector<std::uint32_t>> blocks_of_;  // per slot: of tets at its node
  std::vector<std::uint32_t> due_;                     // blocks of tets, then of smoothing domains
  Stamps is_due_;                                      // per block
  std::vector<Loads> loads_;                           // per tet, after zeros
  bool is_stale_ = true;
  std::vector<std::uint32_t> stale_;                       // blocks, unless is_stale_
  std::vector<TetIndex> tets_;                             // while it follows
  std::vector<RelaxationTerms::Constants> scratch_;        // per worker
  std::vector<std::array<std::uint64_t, 2>> differences_;  // of tets and smoothing domains
};

}  // namespace trocar::dynamics
