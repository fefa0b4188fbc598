#pragma once

// What touches what in this tick.
//
// A push is a capsule against surface nodes: every surface node in the capsule, or within a margin
// of it, gets a half-space whose plane touches the capsule at the point nearest to the node; the
// solver lets nodes leave it freely and resists entering it (stiffness per area), with a viscous
// drag along it. A grasp ties its nodes to places in the tool's frame. Both are constraints on
// single nodes, so the solver's 3x3 blocks stay exact. Only claims in effect act. Nodes that
// another tool holds exclusively are immovable for a push: the pusher feels them, they do not move
// for it. Order: ascending tool slot, then ascending node. O(surface nodes) per pushing tool.

#include <span>
#include <vector>

#include "common/base/index.h"
#include "server/contact/grasps.h"
#include "server/input/tool_table.h"
#include "server/locks/claims.h"
#include "server/world/world.h"

namespace trocar::contact {

// Contact stiffness per surface area, Pa/m, for push and grasp alike. At the 1 cm^2 of a node of a
// 4,000-node liver this is 2.5 kN/m, a hundred times the tissue's own: 0.1 N indents 0.04 mm. Ten
// times less is visibly soft; ten times more slows the solver's convergence. The value of the
// paraboloid tool in graded-exterior's measurements.
inline constexpr float kStiffnessPaPerM = 2.5e7f;
// Drag along the tool's surface while pressed, Pa s/m: keeps nodes from squirting past a tip.
inline constexpr float kDragPaSPerM = 2000.0f;
// The drag rises with the penetration at the start of the tick up to this depth. It stays constant
// in the tick: a drag that switched on inside the solve would make the answer depend on rounding.
inline constexpr float kFullDragMetres = 1e-4f;
// Nodes this near to a tool get a constraint before they touch, so that none slips in during a
// tick.
inline constexpr float kMarginMetres = 0.002f;
inline constexpr std::size_t kMaxNodesPerTool = 1024;

struct NodeConstraint {
  enum class Kind : std::uint8_t { HalfSpace, Tie };

  NodeIndex node;
  Kind kind = Kind::HalfSpace;
  bool moves_node = true;  // false: held by another tool; only the reaction counts
  float stiffness = 0;     // N/m
  float drag = 0;          // N s/m, tangential; HalfSpace only
  Vec3f normal;            // HalfSpace: out of the tool
  Vec3f target;            // displacement: a point of the plane, or where the tie wants the node
  Vec3f tool_motion;       // m in this tick, for the drag
};

struct ToolContact {
  ToolSlot tool;
  std::uint32_t begin = 0, end = 0;              // its constraints
  std::uint32_t seeds_begin = 0, seeds_end = 0;  // nodes from which propagation starts
};

struct ContactList {
  std::vector<ToolContact> tools;  // tools whose claim is in effect and that touch a node
  std::vector<NodeConstraint> constraints;
  std::vector<NodeIndex> seeds;
  // Surface nodes within reach of each tool that wants to grasp and does not hold: core of its
  // request. Range into `reach_nodes` per tool slot.
  std::vector<NodeIndex> reach_nodes;
  std::array<std::pair<std::uint32_t, std::uint32_t>, kMaxTools> reach;
  std::uint32_t dropped = 0;  // nodes beyond kMaxNodesPerTool

  std::span<const NodeIndex> seeds_of(const ToolContact& contact) const {
    return std::span(seeds).subspan(contact.seeds_begin, contact.seeds_end - contact.seeds_begin);
  }
  std::span<const NodeIndex> reach_of(ToolSlot tool) const {
    const auto [begin, end] = reach[tool.value];
    return std::span(reach_nodes).subspan(begin, end - begin);
  }
};

void find_contacts(const world::World& world, const input::ToolTable& tools,
                   const locks::ClaimTable& claims, const GraspTable& grasps, Tick tick,
                   ContactList& out);

}  // namespace trocar::contact
