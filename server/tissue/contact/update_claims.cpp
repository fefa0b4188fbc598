#include "server/tissue/contact/update_claims.h"

namespace trocar::contact {

namespace {

// Jaws that held thread alone have lost it, and have not opened.
bool has_lost_thread(const hands::ClaimRequest& request, const hands::Claim& claim,
                     const Grasp& grasp, Tick tick) {
  return !request.thread.is_held && request.verb == tool::Verb::Grasp &&
         claim.phase == hands::ClaimPhase::Held && claim.verb == tool::Verb::Grasp &&
         grasp.nodes.empty() && tick - request.last_sample_tick <= hands::kLeaseTicks;
}

}  // namespace

void update_claims(const world::World& world, const hands::ToolTable& tools,
                   const ContactList& contacts, std::span<const hands::ThreadGrip> thread_grips,
                   std::vector<hands::ClaimRequest>& requests, hands::ClaimTable& claims,
                   GraspTable& grasps, std::vector<hands::ClaimEvent>& events) {
  requests.clear();
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const auto& tool = tools[ToolSlot{i}];
    if (!tool.has_sample) continue;
    const auto thread = thread_grips.empty() ? hands::ThreadGrip{} : thread_grips[i];
    const auto core =
        thread.is_held ? std::span<const NodeIndex>{} : contacts.reach_of(ToolSlot{i});
    requests.push_back({ToolSlot{i}, tool.verb, tool.last_sample_tick, core, thread});
  }
  for (const auto& request : requests)
    if (has_lost_thread(request, claims.claim(request.tool), grasps[request.tool], world.tick))
      claims.slip_off(request.tool, world.tick, events);
  grasps.update_slip(contacts, world, claims, events);
  claims.update(world.tick, requests, events);
  grasps.update_holds(world, tools, claims, requests);
}

}  // namespace trocar::contact
