#include "server/contact/contact_list.h"

#include <algorithm>
#include <cmath>

namespace trocar::contact {
namespace {

// Capsule in the world frame: its tip is the outermost point, so the first sphere's centre lies one
// radius up the shaft.
struct Capsule {
  Vec3f begin, axis;  // axis: unit vector along the shaft
  float length = 0, radius = 0;

  explicit Capsule(const input::Tool& tool)
      : axis(rotate(tool.pose.orientation, {0, 0, 1})),
        length(std::max(0.0f, tool.shape.length_m - 2 * tool.shape.radius_m)),
        radius(tool.shape.radius_m) {
    begin = tool.pose.position + axis * radius;
  }
  Vec3f nearest_on_axis(const Vec3f& p) const {
    return begin + axis * std::clamp(dot(p - begin, axis), 0.0f, length);
  }
};

void find_push(const world::World& world, const locks::ClaimTable& claims, const input::Tool& tool,
               ToolSlot slot, float strength, ContactList& out) {
  const Capsule capsule(tool);
  const float range = capsule.radius + kMarginMetres;
  const std::size_t first = out.constraints.size();
  for (const auto node : world.surface_nodes) {
    const Vec3f p = world.position(node);
    const Vec3f from_axis = p - capsule.nearest_on_axis(p);
    const float distance_squared = length_squared(from_axis);
    if (distance_squared > range * range) continue;
    if (out.constraints.size() - first >= kMaxNodesPerTool) {
      ++out.dropped;
      continue;
    }
    const Vec3f normal = normalized(from_axis, capsule.axis);
    const Vec3f on_plane = p - from_axis + normal * capsule.radius;
    const auto owner = claims.owner(node);
    const float area = world.surface_areas[node.value] * strength;
    const float pressed = capsule.radius - std::sqrt(distance_squared);
    const float grip = std::clamp(pressed / kFullDragMetres, 0.0f, 1.0f);
    out.constraints.push_back({.node = node,
                               .kind = NodeConstraint::Kind::HalfSpace,
                               .moves_node = !owner.is_valid() || owner == slot,
                               .stiffness = kStiffnessPaPerM * area,
                               .drag = kDragPaSPerM * area * grip,
                               .normal = normal,
                               .target = on_plane - world.rest_positions[node.value],
                               .tool_motion = tool.tip_motion});
    // Propagation starts at the nodes that the tool truly touches.
    if (distance_squared <= capsule.radius * capsule.radius) out.seeds.push_back(node);
  }
}

void add_ties(const world::World& world, const Grasp& grasp, const Pose& pose, float strength,
              ContactList& out) {
  for (std::size_t i = 0; i < grasp.nodes.size(); ++i) {
    const auto node = grasp.nodes[i];
    out.constraints.push_back(
        {.node = node,
         .kind = NodeConstraint::Kind::Tie,
         .stiffness = kStiffnessPaPerM * world.surface_areas[node.value] * strength,
         .target = pose.apply(grasp.offsets[i]) - world.rest_positions[node.value]});
    out.seeds.push_back(node);
  }
}

void find_reach(const world::World& world, const input::Tool& tool, ContactList& out) {
  const float reach = tool.shape.reach_m;
  const std::size_t first = out.reach_nodes.size();
  for (const auto node : world.surface_nodes) {
    if (world.node_classes[node.value] == world::NodeClass::Fixed) continue;
    if (length_squared(world.position(node) - tool.pose.position) > reach * reach) continue;
    if (out.reach_nodes.size() - first >= kMaxNodesPerTool) {
      ++out.dropped;
      continue;
    }
    out.reach_nodes.push_back(node);
  }
}

}  // namespace

void find_contacts(const world::World& world, const input::ToolTable& tools,
                   const locks::ClaimTable& claims, const GraspTable& grasps, Tick tick,
                   ContactList& out) {
  out.tools.clear();
  out.constraints.clear();
  out.seeds.clear();
  out.reach_nodes.clear();
  out.reach.fill({0, 0});
  out.dropped = 0;
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const ToolSlot slot{i};
    const auto& tool = tools[slot];
    const auto& claim = claims.claim(slot);
    if (claims.is_in_effect(slot)) {
      ToolContact contact{.tool = slot};
      contact.begin = static_cast<std::uint32_t>(out.constraints.size());
      contact.seeds_begin = static_cast<std::uint32_t>(out.seeds.size());
      const float strength = claims.strength(slot, tick);
      if (claim.verb == scene::Verb::Grasp)
        add_ties(world, grasps[slot], grasps.pose(slot, tool), strength, out);
      else if (tool.has_sample)
        find_push(world, claims, tool, slot, strength, out);
      contact.end = static_cast<std::uint32_t>(out.constraints.size());
      contact.seeds_end = static_cast<std::uint32_t>(out.seeds.size());
      if (contact.end != contact.begin) out.tools.push_back(contact);
    } else if (tool.has_sample && tool.verb == scene::Verb::Grasp) {
      const auto begin = static_cast<std::uint32_t>(out.reach_nodes.size());
      find_reach(world, tool, out);
      out.reach[i] = {begin, static_cast<std::uint32_t>(out.reach_nodes.size())};
    }
  }
}

}  // namespace trocar::contact
