#pragma once

// The end of a tick's mechanics, in sessions and scenarios alike: grasps lose what slipped, each
// tool asks for what its verb needs, the claims are decided, and grasps follow what was granted.
// Valid from the next tick.

#include <span>
#include <vector>

#include "server/tissue/contact/contact_list.h"
#include "server/tissue/contact/grasps.h"

namespace trocar::contact {

// Tools that have not shown themselves ask for nothing. `requests` is scratch: its cores point into
// `contacts`. thread_grips: by tool; empty: there is no thread. What a person should hear of is
// appended to `events`.
void update_claims(const world::World& world, const hands::ToolTable& tools,
                   const ContactList& contacts, std::span<const hands::ThreadGrip> thread_grips,
                   std::vector<hands::ClaimRequest>& requests, hands::ClaimTable& claims,
                   GraspTable& grasps, std::vector<hands::ClaimEvent>& events);

}  // namespace trocar::contact
