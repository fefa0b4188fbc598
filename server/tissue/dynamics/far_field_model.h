#pragma once

// The one hook by which a session's far field may be moved in another way than by sweeps: asked in
// each tick, it takes the far field over and hands it back. A tick knows nothing else of it.
//
// The model's choice is a function of its state and of the tissue's alone; that state is in
// snapshot and hash. No allocation in a tick unless it hands over. One caller.

#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "common/wire/figures.h"
#include "server/tissue/dynamics/block_descent.h"
#include "server/tissue/topology/edit.h"

namespace trocar::dynamics {

class FarFieldModel {
 public:
  virtual ~FarFieldModel() = default;

  struct Inputs {
    const contact::ContactList& contacts;
    std::span<const NodeIndex> active;  // nodes that are swept most where sweeps move everything
    world::Boundary boundary;
    bool is_off = false;  // by decision
  };
  struct Choice {
    std::span<const NodeIndex> near;  // the nodes to be swept
    FarFieldSolver* far;              // moves all others
  };
  // Before each solve: decides for one tick, and hands over if need be. None: sweeps move all.
  virtual std::optional<Choice> choose(const Inputs& inputs, BlockDescent& solver,
                                       world::World& world) = 0;
  // The topology has changed, and the world will: sweeps go on from here.
  virtual void stop_for(const topology::Edit& edit, BlockDescent& solver, world::World& world) = 0;

  virtual void visit_state(world::StateArchive& archive) = 0;
  // After a state was read. False: it does not fit this model.
  virtual bool resume() = 0;

  // Returns the figures of the last choice.
  virtual const wire::SolverFigures& figures() const = 0;
};

// Makes models for simulations of one organ that share what never changes.
class FarFieldModels {
 public:
  virtual ~FarFieldModels() = default;
  // This outlives it.
  virtual std::unique_ptr<FarFieldModel> make() const = 0;
};

// The organ outlives what is made for it. Empty: sweeps move everything.
using MakeFarFieldModels =
    std::function<std::unique_ptr<const FarFieldModels>(const organ::Organ& organ)>;

}  // namespace trocar::dynamics
