#include "server/tissue/step/rest.h"

namespace trocar::step {

bool may_rest(const TickDecisions& decisions, const ExternalLoads* loads) {
  return decisions.boundary == world::Boundary::Graded && decisions.policy.steps_per_tick == 1 &&
         loads == nullptr;
}

void wake_touched(bool may_rest, bool has_self_contact, State& state, pieces::Pieces& pieces,
                  ContactWork& contact) {
  auto& found = contact.found;
  if (!may_rest) pieces.wake(state.world);
  pieces.wake_touched(found, state.world);
  if (pieces.changed().empty()) return;
  found.points.resize(found.self_begin);
  found.self_seeds.clear();
  if (has_self_contact) contact.self_finder.find_again(state.world, state.self_contacts, found);
}

bool begin_solving(bool may_rest, const world::World& world, pieces::Pieces& pieces,
                   dynamics::BlockDescent& solver) {
  hand_out_changes(world, pieces, solver);
  if (may_rest) pieces.begin_step(world);
  solver.use_energies(may_rest ? pieces.turning() : std::span<const NodeIndex>{});
  solver.let_spring(may_rest ? pieces.free() : std::span<const NodeIndex>{});
  return !may_rest || !pieces.is_all_asleep();
}

pieces::Pieces::Motion end_solving(bool may_rest, const contact::ContactList& contacts,
                                   world::World& world, pieces::Pieces& pieces,
                                   dynamics::BlockDescent& solver) {
  if (!may_rest) return {};
  const auto motion = pieces.end_step(contacts, world);
  hand_out_changes(world, pieces, solver);
  return motion;
}

void hand_out_changes(const world::World& world, pieces::Pieces& pieces,
                      dynamics::BlockDescent& solver) {
  solver.read_state(world, pieces.changed());
  pieces.clear_changes();
}

}  // namespace trocar::step
