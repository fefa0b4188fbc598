#pragma once

// Which solver moves the tissue: the full one, or around a patch of a local reduction sweeps and
// beyond it the patch's fields (server/tissue/reduction/local_exterior.h). The choice is a function
// of the state alone, made each tick.

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "common/base/background.h"
#include "common/base/tick.h"
#include "server/tissue/contact/contact_list.h"
#include "server/tissue/dynamics/block_descent.h"
#include "server/tissue/reduction/local_exterior.h"
#include "server/tissue/world/world.h"

namespace trocar::step {

// Why the solver is what it is.
enum class SolverReason : std::uint8_t {
  None,       // the session has no reduction
  Idle,       // nothing has been touched yet
  Fits,       // a patch has what is touched
  Frozen,     // the tissue beyond the limits stands still
  Outside,    // touched where no patch is, or by tools that touch more patches than act together
  Force,      // a node bears more than in the training
  Cut,        // tissue was cut just now, or is where it is touched
  Error,      // the estimate of the error is too large
  Off,        // it was decided so
  Preparing,  // patches that are touched together are being made ready to act together
};
inline constexpr std::uint8_t kSolverReasons = 10;
const char* name_of(SolverReason reason);

// Which solver acted in a tick.
struct SolverFigures {
  bool is_reduced = false;
  SolverReason reason = SolverReason::None;
  reduction::PatchSet patches;  // of the reduction, while they act
  float estimate = 0;           // of its error (reduction::LocalExterior), of the tick before
  float largest_node_force_n = 0;
};
// From one tick to the next another solver, or patch, or reason.
struct SolverChange {
  Tick tick = 0;
  SolverFigures figures;
};

// In snapshot and hash of sessions with a reduction.
struct ReducedState {
  static constexpr std::size_t kMaxReady = 4;

  void visit_state(world::StateArchive& archive, const reduction::LocalModels& models);

  reduction::ExteriorState exterior;
  SolverReason reason = SolverReason::Idle;
  std::uint16_t wait_ticks = 0;  // until patches may take over again
  // Patches that are being made ready, and ticks until they are; those that were, the latest last.
  reduction::PatchSet preparing;
  std::uint32_t prepare_ticks = 0;
  std::array<reduction::PatchSet, kMaxReady> ready{};
  std::uint32_t ready_count = 0;
  std::vector<std::uint8_t> is_cut;  // per patch: its tissue is no longer what it is of
};

class ReducedTissue {
 public:
  // Outlives it.
  explicit ReducedTissue(const reduction::LocalModels& models);

  // Of a state that was restored: makes its patches ready. False: the state is of others.
  bool resume(const ReducedState& state);

  struct Inputs {
    const contact::ContactList& contacts;
    std::span<const NodeIndex> active;  // nodes that the full solver sweeps most
    world::Boundary boundary;
    bool is_off = false;  // by decision
  };
  // Decides for one tick, hands over if need be, and says whether a patch acts. If so, near() are
  // the nodes to be swept and exterior() is to move the rest.
  bool choose(const Inputs& inputs, ReducedState& state, dynamics::BlockDescent& solver,
              world::World& world);
  std::span<const NodeIndex> near() const { return near_; }
  dynamics::Exterior& exterior() { return exterior_; }
  // The tissue was cut at these nodes, before the world follows: the full solver goes on, and for
  // good where patches are that have one of them.
  void stop_for_cut(std::span<const NodeIndex> changed, ReducedState& state,
                    dynamics::BlockDescent& solver, world::World& world);

  const SolverFigures& figures() const { return figures_; }

 private:
  using Model = std::shared_ptr<const reduction::PatchModel>;
  struct Joint {
    reduction::PatchSet patches;
    Model model;
  };

  SolverReason decide(const Inputs& inputs, ReducedState& state, const world::World& world,
                      reduction::PatchSet& patches);
  // The nearest patch that has room for the nodes and was not cut; false: there is none.
  bool find_patch(std::span<const NodeIndex> nodes, const ReducedState& state,
                  const world::World& world, std::uint32_t& patch, bool& is_near_cut) const;
  bool is_ready(const reduction::PatchSet& patches, ReducedState& state);
  Model model_of(const reduction::PatchSet& patches);
  void hand_back(ReducedState& state, dynamics::BlockDescent& solver, world::World& world);
  float largest_node_force(const contact::ContactList& contacts, const world::World& world);

  const reduction::LocalModels& models_;
  reduction::LocalExterior exterior_;
  Model acting_;               // null: the full solver
  std::vector<Joint> joints_;  // some of those that are ready
  Joint making_;
  SolverFigures figures_;
  std::vector<NodeIndex> near_;
  std::vector<Vec3f> gradient_;
  std::vector<NodeIndex> loaded_;
  std::vector<Vec3f> node_forces_;  // of loaded_
  Background background_;           // last: its work uses what stands above
};

}  // namespace trocar::step
