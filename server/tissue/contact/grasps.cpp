#include "server/tissue/contact/grasps.h"

#include <algorithm>
#include <cmath>

#include "server/tissue/contact/contact_law.h"

namespace trocar::contact {
namespace {

// Returns how far jaws of this reach go from one pose to another, at most.
float jaws_way(const Pose& a, const Pose& b, float reach_m) {
  const auto &p = a.orientation, &q = b.orientation;
  const float cosine = std::min(1.0f, std::abs(p.x * q.x + p.y * q.y + p.z * q.z + p.w * q.w));
  return length(b.position - a.position) + 2 * reach_m * std::sqrt(2 - 2 * cosine);
}

}  // namespace

void GraspTable::anchor(ToolSlot slot) {
  Grasp& grasp = grasps_[slot.value];
  if (!grasp.nodes.empty()) grasp.is_anchored = true;
}

void GraspTable::follow(const hands::ToolTable& tools, std::uint32_t held_back) {
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    Grasp& grasp = grasps_[i];
    if (grasp.nodes.empty()) continue;
    const Pose& hand = tools[ToolSlot{i}].pose;
    const bool is_held_back = (held_back >> i & 1) != 0;
    const float way = grasp.is_anchored ? 0 : jaws_way(grasp.jaws, hand, grasp.reach_m);
    const float most = is_held_back ? kHeldBack_m : grasp.is_behind ? kCatchUp_m : INFINITY;
    grasp.is_behind = way > most;
    if (!grasp.is_anchored)
      grasp.jaws = grasp.is_behind ? part_of_way(grasp.jaws, hand, most / way) : hand;
  }
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
      grasp.is_anchored = grasp.is_behind = false;
      grasp.jaws = {};
    } else if (claim.phase == hands::ClaimPhase::Ramping) {
      anchor(slot);
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
    grasp.jaws = tools[request.tool].pose;
    for (const auto node : request.core) {
      grasp.nodes.push_back(node);
      grasp.offsets.push_back(grasp.jaws.apply_inverse(world.position(node)));
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
    archive.flag(grasp.is_behind);
    archive.value(grasp.jaws);
    if (!archive.is_reading()) continue;
    const auto& turn = grasp.jaws.orientation;
    if (!is_finite(grasp.jaws.position) || !is_finite(Vec3f{turn.x, turn.y, turn.z}) ||
        !std::isfinite(turn.w))
      archive.fail();
    if (grasp.nodes.size() != grasp.offsets.size()) archive.fail();
    for (const auto node : grasp.nodes)
      if (node.value >= node_count) archive.fail();
  }
}

}  // namespace trocar::contact
