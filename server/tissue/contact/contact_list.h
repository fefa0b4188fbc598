#pragma once

// The list says what touches what in this tick, as the solver sees it: quadrature points of the
// surface (surface.h), each a fixed combination of a triangle's nodes, and what acts on them.
//
// Push: the point may not enter the tool. The tool's face there is a plane; the point leaves it
//   freely and is resisted behind it, in proportion to depth and to the surface that the point
//   stands for, up to the greatest pressure that a hand exerts; friction holds it to the tool's
//   frame up to the Coulomb limit.
// Grip: a node between a grasp's jaws is held to a point of their frame in all directions, up to
//   the force at which it slips.
// Nodes that another tool holds exclusively do not move for a push: the pusher feels them.
// Tissue on tissue (self_contact.h): a Push whose point is a node's displacement less that of the
//   closest point of the triangle across, so that it acts on both alike and nothing is added to the
//   whole.
//
// Order: ascending tool slot, then ascending triangle and point (a grip: node); tissue on tissue
// last, by node.

#include <array>
#include <span>
#include <vector>

#include "common/base/ids.h"
#include "common/base/index.h"
#include "common/math/frame.h"
#include "common/tool/tool.h"
#include "server/tissue/world/world.h"

namespace trocar::contact {

// Searches reach so much farther than distances say, for the rounding of places.
inline constexpr float kRounding_m = 1e-5f;

inline constexpr std::size_t kMaxPointsPerTool = 8192;
inline constexpr std::size_t kMaxSelfPoints = 16384;
inline constexpr int kMaxPointNodes = 4;

struct ContactPoint {
  enum class Kind : std::uint8_t { Push, Grip };

  std::array<NodeIndex, kMaxPointNodes> nodes;
  std::array<float, kMaxPointNodes> weights{};  // sum 1; of tissue on tissue: 1, then sum -1
  Kind kind = Kind::Push;
  std::uint8_t node_count = 3;
  std::uint8_t moved = 0b1111;  // bit i: nodes[i] moves for it
  std::uint32_t id = 0;         // which point of the surface, see ContactFinder; a grip: its entry
  float stiffness = 0;          // N/m, along the normal; a grip: in all directions
  float hold_stiffness = 0;     // N/m, of friction across the normal
  float friction = 0;           // Coulomb's coefficient
  float limit_n = 0;            // a push presses no harder; a grip slips above it
  Vec3f normal;                 // out of the tool
  Vec3f plane;                  // displacement of the point when it touches the tool's face
  Vec3f anchor;                 // displacement at which friction or grip does not pull
};

// The combination of its nodes' values; of_nodes: per node of the organ.
inline Vec3f value_at(const ContactPoint& point, std::span<const Vec3f> of_nodes) {
  Vec3f sum;
  for (std::size_t k = 0; k < point.node_count; ++k)
    sum += of_nodes[point.nodes[k].value] * point.weights[k];
  return sum;
}
inline Vec3f displacement_of(const ContactPoint& point, const world::World& world) {
  return value_at(point, world.displacements);
}
inline Vec3f rest_position_of(const ContactPoint& point, const world::World& world) {
  return value_at(point, world.rest_positions);
}

// The tip of a tool that is held back goes so far in a tick, 3 cm/s, while it presses or holds.
inline constexpr float kHeldBack_m = 0.00003f;

// A tool whose claim is in effect, whether or not it touches anything.
struct ToolContact {
  ToolSlot tool;
  tool::Verb verb = tool::Verb::None;
  bool is_placed = false;                        // a push: its proxy is outside the tissue
  Pose start, goal;                              // world_from_tool; this tick's planes are of goal
  float softness_m = 0;                          // how deep a push's pressure grows
  std::uint32_t begin = 0, end = 0;              // its points
  std::uint32_t seeds_begin = 0, seeds_end = 0;  // nodes from which propagation starts
};

struct ContactList {
  std::vector<ToolContact> tools;
  std::vector<ContactPoint> points;
  std::vector<NodeIndex> seeds;  // per tool ascending, each once; what is below has its own
  // Tissue on tissue: points from here on, and the nodes of those that press.
  std::uint32_t self_begin = 0;
  std::vector<NodeIndex> self_seeds;  // ascending, each once
  // Surface nodes within reach of each tool that wants to grasp and does not hold: core of its
  // request. Range into `reach_nodes` per tool slot.
  std::vector<NodeIndex> reach_nodes;
  std::array<std::pair<std::uint32_t, std::uint32_t>, kMaxTools> reach;
  std::uint32_t tools_inside = 0;  // that appeared inside tissue and have not come out
  std::uint32_t dropped = 0;       // points or nodes beyond kMaxPointsPerTool or kMaxSelfPoints

  void reserve();
  void clear();
  std::span<const ContactPoint> points_of(const ToolContact& contact) const {
    return std::span(points).subspan(contact.begin, contact.end - contact.begin);
  }
  std::span<const ContactPoint> self_points() const {
    return std::span(points).subspan(self_begin);
  }
  std::span<const NodeIndex> seeds_of(const ToolContact& contact) const {
    return std::span(seeds).subspan(contact.seeds_begin, contact.seeds_end - contact.seeds_begin);
  }
  std::span<const NodeIndex> reach_of(ToolSlot tool) const {
    const auto [begin, end] = reach[tool.value];
    return std::span(reach_nodes).subspan(begin, end - begin);
  }
};

}  // namespace trocar::contact
