#include "server/tissue/contact/grasps.h"

#include <algorithm>

#include "server/tissue/contact/contact_law.h"

namespace trocar::contact {

void GraspTable::anchor(ToolSlot slot, const Pose& pose) {
  Grasp& grasp = grasps_[slot.value];
  if (grasp.nodes.empty() || grasp.is_anchored) return;
  grasp.is_anchored = true;
  grasp.anchor = pose;
}

void GraspTable::update_holds(const world::World& world, const hands::ToolTable& tools,
                              const hands::ClaimTable& claims,
                              std::span<const hands::ClaimRequest> requests) {
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const ToolSlot slot{i};
    Grasp& grasp = grasps_[i];
    const auto& claim = claims.claim(slot);
    const bool grips = claims.is_in_effect(slot) && claim.verb == tool::Verb::Grasp;
    if (!grips) {
      grasp.nodes.clear();
      grasp.offsets.clear();
      grasp.grip_n = grasp.reach_m = grasp.closed = 0;
      grasp.is_anchored = false;
      grasp.anchor = {};
    } else if (claim.phase == hands::ClaimPhase::Ramping) {
      anchor(slot, tools[slot].pose);
    } else {
      grasp.closed = std::min(1.0f, grasp.closed + 1 / kClosingTicks);
    }
  }
  for (const auto& request : requests) {
    const auto& claim = claims.claim(request.tool);
    Grasp& grasp = grasps_[request.tool.value];
    const bool is_new = claim.phase == hands::ClaimPhase::Held && claim.verb == tool::Verb::Grasp &&
                        grasp.nodes.empty();
    if (!is_new) continue;
    grasp.grip_n = tools[request.tool].shape.grip_n;
    grasp.reach_m = tools[request.tool].shape.reach_m;
    for (const auto node : request.core) {
      grasp.nodes.push_back(node);
      grasp.offsets.push_back(tools[request.tool].pose.apply_inverse(world.position(node)));
    }
  }
}

void GraspTable::update_slip(const ContactList& contacts, const world::World& world,
                             hands::ClaimTable& claims, std::vector<hands::ClaimEvent>& events) {
  // A node is lost this much beyond the reach within which jaws take hold, so that a hold that has
  // just begun does not end at its rim.
  constexpr float kLostBeyond = 1.25f;
  for (const auto& tool : contacts.tools) {
    if (tool.verb != tool::Verb::Grasp) continue;
    Grasp& grasp = grasps_[tool.tool.value];
    const float lost = kLostBeyond * grasp.reach_m;
    bool has_lost = false;
    for (const auto& point : contacts.points_of(tool)) {
      const Vec3f d = displacement_of(point, world);
      const auto load = load_at(point, d);
      if (!load.slides) continue;
      const Vec3f held = d - load.slip * (load.tangential_secant / point.stiffness);
      Vec3f& offset = grasp.offsets[point.id];
      offset = tool.goal.apply_inverse(rest_position_of(point, world) + held);
      offset.x /= 1 - kSqueeze * grasp.closed;
      if (!(length_squared(offset) > lost * lost)) continue;
      claims.release_node(tool.tool, grasp.nodes[point.id]);
      grasp.nodes[point.id] = NodeIndex();
      has_lost = true;
    }
    if (!has_lost) continue;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < grasp.nodes.size(); ++i) {
      if (!grasp.nodes[i].is_valid()) continue;
      grasp.nodes[kept] = grasp.nodes[i];
      grasp.offsets[kept++] = grasp.offsets[i];
    }
    grasp.nodes.resize(kept);
    grasp.offsets.resize(kept);
    if (kept == 0) claims.slip_off(tool.tool, world.tick, events);
  }
}

bool GraspTable::holds(NodeIndex node) const {
  return std::ranges::any_of(grasps_, [node](const Grasp& grasp) {
    return std::ranges::binary_search(grasp.nodes, node);
  });
}

void GraspTable::add_copy(NodeIndex node, NodeIndex copy) {
  for (auto& grasp : grasps_) {
    const auto at = std::ranges::lower_bound(grasp.nodes, node);
    if (at == grasp.nodes.end() || *at != node || grasp.nodes.size() >= kMaxPointsPerTool) continue;
    const Vec3f offset = grasp.offsets[static_cast<std::size_t>(at - grasp.nodes.begin())];
    const auto place = std::ranges::lower_bound(grasp.nodes, copy) - grasp.nodes.begin();
    grasp.nodes.insert(grasp.nodes.begin() + place, copy);
    grasp.offsets.insert(grasp.offsets.begin() + place, offset);
  }
}

void GraspTable::visit_state(world::StateArchive& archive, std::size_t node_count) {
  for (auto& grasp : grasps_) {
    archive.sized_array(grasp.nodes, kMaxPointsPerTool);
    archive.sized_array(grasp.offsets, kMaxPointsPerTool);
    archive.value(grasp.grip_n);
    archive.value(grasp.reach_m);
    archive.value(grasp.closed);
    archive.flag(grasp.is_anchored);
    archive.value(grasp.anchor);
    if (!archive.is_reading()) continue;
    if (grasp.nodes.size() != grasp.offsets.size()) archive.fail();
    for (const auto node : grasp.nodes)
      if (node.value >= node_count) archive.fail();
  }
}

}  // namespace trocar::contact
