#include "server/tissue/contact/update_claims.h"

namespace trocar::contact {

void update_claims(const world::World& world, const hands::ToolTable& tools,
                   const ContactList& contacts, std::vector<hands::ClaimRequest>& requests,
                   hands::ClaimTable& claims, GraspTable& grasps,
                   std::vector<hands::ClaimEvent>& events) {
  requests.clear();
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const auto& tool = tools[ToolSlot{i}];
    if (!tool.has_sample) continue;
    requests.push_back(
        {ToolSlot{i}, tool.verb, tool.last_sample_tick, contacts.reach_of(ToolSlot{i})});
  }
  grasps.update_slip(contacts, world, claims, events);
  claims.update(world.tick, requests, events);
  grasps.update_holds(world, tools, claims, requests);
}

}  // namespace trocar::contact
