#include "server/contact/grasps.h"

#include "server/contact/contact_list.h"

namespace trocar::contact {

void GraspTable::anchor(ToolSlot slot, const Pose& pose) {
  Grasp& grasp = grasps_[slot.value];
  if (grasp.nodes.empty() || grasp.is_anchored) return;
  grasp.is_anchored = true;
  grasp.anchor = pose;
}

void GraspTable::follow_claims(const world::World& world, const input::ToolTable& tools,
                               const locks::ClaimTable& claims,
                               std::span<const locks::ClaimRequest> requests) {
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const ToolSlot slot{i};
    Grasp& grasp = grasps_[i];
    const auto& claim = claims.claim(slot);
    const bool grips = claims.is_in_effect(slot) && claim.verb == scene::Verb::Grasp;
    if (!grips) {
      grasp.nodes.clear();
      grasp.offsets.clear();
      grasp.is_anchored = false;
      grasp.anchor = {};
    } else if (claim.phase == locks::ClaimPhase::Ramping) {
      anchor(slot, tools[slot].pose);
    }
  }
  for (const auto& request : requests) {
    const auto& claim = claims.claim(request.tool);
    Grasp& grasp = grasps_[request.tool.value];
    const bool is_new = claim.phase == locks::ClaimPhase::Held &&
                        claim.verb == scene::Verb::Grasp && grasp.nodes.empty();
    if (!is_new) continue;
    for (const auto node : request.core) {
      grasp.nodes.push_back(node);
      grasp.offsets.push_back(tools[request.tool].pose.apply_inverse(world.position(node)));
    }
  }
}

void GraspTable::visit_state(world::StateArchive& archive, std::size_t node_count) {
  for (auto& grasp : grasps_) {
    archive.sized_array(grasp.nodes, kMaxNodesPerTool);
    archive.sized_array(grasp.offsets, kMaxNodesPerTool);
    archive.flag(grasp.is_anchored);
    archive.value(grasp.anchor);
    if (!archive.is_reading()) continue;
    if (grasp.nodes.size() != grasp.offsets.size()) archive.fail();
    for (const auto node : grasp.nodes)
      if (node.value >= node_count) archive.fail();
  }
}

}  // namespace trocar::contact
