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
