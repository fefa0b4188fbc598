// This file answers queries about the solver between steps.

#include "common/base/assert.h"
#include "server/tissue/dynamics/block_descent.h"

namespace trocar::dynamics {

Vec3f BlockDescent::holding_force(const contact::ContactList& contacts, NodeIndex node) const {
  const Slot slot = tissue_.groups().slot_of(node);
  const Group group = slot / kLanes;
  TROCAR_ASSERT_HOT(begun_stamp_[group] == current_);
  NodeStep8 step = linearise(group, load_group(&x_[group * kLanes]));
  Lanes omega;
  if (group_stamp_[group] == current_) add_contacts(contacts, slots_of(group), step, omega);
  Vec3Lanes gradients;
  store(gradients, step.gradient);
  return gradients.at(slot % kLanes);
}

void BlockDescent::elastic_gradient(std::span<Vec3f> gradient) {
  restart_nodal_strain();
  for_each_group(all_groups_, [&](Group g) {
    tissue_.begin_group(g, x_.data(), 0);
    NodeStep8 step{zero_vec8(), zero_sym_mat8()};
    tissue_.add(g, x_.data(), load_group(&x_[g * kLanes]), step);
    Vec3Lanes gradients;
    store(gradients, step.gradient);
    const auto nodes = tissue_.groups().nodes_of(g);
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      if (nodes[lane].is_valid()) gradient[nodes[lane].value] = gradients.at(lane);
  });
}

FarPlan BlockDescent::far_plan(float dt) {
  const auto traces = tissue_.traces_at_rest(0, !has_explicit_strain_);
  double stiffness = 0, mass = 0;
  for (std::size_t slot = 0; slot < traces.size(); ++slot) {
    const std::size_t group = slot / kLanes, lane = slot % kLanes;
    if ((free_[group] >> lane & 1) == 0) continue;
    stiffness += static_cast<double>(traces[slot]) / 3;
    mass += static_cast<double>(constants_[group].mass.v[lane]);
  }
  return FarPlan::of(stiffness, mass, static_cast<double>(dt));
}

}  // namespace trocar::dynamics
