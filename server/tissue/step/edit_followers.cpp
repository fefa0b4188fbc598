#include "server/tissue/step/edit_followers.h"

#include "server/tissue/step/rest.h"

namespace trocar::step {

void hand_out(const topology::Edit& edit, State& state) {
  state.world.apply(edit);
  state.cuts.extend_layout(edit, state.world);
  state.quantised.resize(state.cuts.layout().vertex_count());
  state.self_contacts.note_edit();
  for (const auto& made : edit.new_nodes) {
    if (made.has_moved()) continue;
    state.claims.add_node(made.a, made.b);
    if (made.is_copy()) state.grasps.add_copy(made.a, made.node);
  }
}

void hand_out(const topology::Edit& edit, const world::World& world, ContactWork& contact,
              NearWork& near, SolveWork& solve) {
  near.neighbours.update_changed(edit.topology);
  near.queue.forget(world.node_count());
  near.active.forget();
  contact.finder.update(edit.surface, world);
  contact.self_finder.update(edit, world);
  solve.solver.update_topology(edit.topology, world);  // and with it its far field
}

void hand_out(const topology::Edit& edit, State& state, pieces::Pieces& pieces,
              ContactWork& contact, NearWork& near, SolveWork& solve) {
  hand_out(edit, state);
  pieces.update(edit, state.world);
  hand_out(edit, state.world, contact, near, solve);
  hand_out_changes(state.world, pieces, solve.solver);
  solve.solver.refresh_relaxed_forces(state.world);
}

}  // namespace trocar::step
