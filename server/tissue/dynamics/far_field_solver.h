#pragma once

// A far-field solver moves the nodes that are not swept, in fields over the whole organ: a few
// unknowns instead of three per node (server/lab/reduce). Between two sweeps it corrects what
// sweeping finds, swept nodes included.

#include <span>

#include "common/base/index.h"
#include "server/tissue/contact/contact_list.h"
#include "server/tissue/dynamics/groups.h"
#include "server/tissue/world/world.h"

namespace trocar::dynamics {

// A step as it stands. The world is as it was at its start; near: nodes that are swept, as given to
// the solver.
struct FarFieldStep {
  const Groups& groups;
  Float4* x;  // displacements per slot
  const world::World& world;
  const contact::ContactList& contacts;
  std::span<const NodeIndex> near;
  float dt = 1e-3f;  // s
};

class FarFieldSolver {
 public:
  virtual ~FarFieldSolver() = default;

  // Near nodes are where their inertia leads them, others where they were.
  virtual void begin(const FarFieldStep& step) = 0;
  virtual void correct(const FarFieldStep& step) = 0;
  // Near nodes are in the world as they end the step. Puts the others there and says how far the
  // farthest has moved, m. `velocities`: per slot.
  virtual float end(const FarFieldStep& step, Float4* velocities, world::World& world) = 0;
};

}  // namespace trocar::dynamics
