#pragma once

// Which solver moves the tissue: the full one, or around a patch of a local reduction sweeps and
// beyond it the patch's fields (server/exterior/local_exterior.h). The choice is a function of the
// state alone, made each tick.

#include <memory>
#include <span>
#include <vector>

#include "common/base/tick.h"
#include "server/contact/contact_list.h"
#include "server/dynamics/block_descent.h"
#include "server/exterior/local_exterior.h"
#include "server/world/world.h"

namespace trocar::step {

// Why the solver is what it is.
enum class SolverReason : std::uint8_t {
  None,     // the session has no reduction
  Idle,     // nothing has been touched yet
  Fits,     // a patch has what is touched
  Frozen,   // the tissue beyond the limits stands still
  Outside,  // touched where no patch is, or where several tools touch more than one patch
  Force,    // a node bears more than in the training
  Cut,      // tissue of the patch was cut
  Error,    // the estimate of the error is too large
  Off,      // it was decided so
};
inline constexpr std::uint8_t kSolverReasons = 9;
const char* name_of(SolverReason reason);

// Which solver acted in a tick.
struct SolverFigures {
  bool is_reduced = false;
  SolverReason reason = SolverReason::None;
  std::uint32_t patch = 0;  // of the reduction, while it acts
  float estimate = 0;       // of its error (exterior::LocalExterior), of the tick before
  float largest_node_force_n = 0;
};
// From one tick to the next another solver, or patch, or reason.
struct SolverChange {
  Tick tick = 0;
  SolverFigures figures;
};

// In snapshot and hash of sessions with a reduction.
struct ReducedState {
  void visit_state(world::StateArchive& archive);

  exterior::ExteriorState exterior;
  SolverReason reason = SolverReason::Idle;
  std::uint16_t wait_ticks = 0;  // until a patch may take over again
  bool was_cut = false;
};

class ReducedTissue {
 public:
  // Outlives it.
  explicit ReducedTissue(const exterior::LocalModels& models);

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
  // The topology is about to change: the full solver goes on.
  void stop_for_cut(ReducedState& state, dynamics::BlockDescent& solver, world::World& world);

  const SolverFigures& figures() const { return figures_; }

 private:
  SolverReason decide(const Inputs& inputs, const ReducedState& state, const world::World& world,
                      std::uint32_t& patch);
  bool has_room(std::uint32_t patch) const;
  float largest_node_force(const contact::ContactList& contacts, const world::World& world);

  const exterior::LocalModels& models_;
  exterior::LocalExterior exterior_;
  SolverFigures figures_;
  std::vector<NodeIndex> touched_, near_;
  std::vector<Vec3f> gradient_;
  std::vector<NodeIndex> loaded_;
  std::vector<Vec3f> node_forces_;  // of loaded_
};

}  // namespace trocar::step
