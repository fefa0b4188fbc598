#pragma once

// The table says which nodes each grasping tool holds, and where in its frame. A grasp is created
// when a claim is granted, dropped when it ends. Each node is held with its share, by surface area,
// of the grip: pulled harder it slips between the jaws, and is lost where it leaves them; a grasp
// that has lost all of its nodes has slipped off. Jaws close in kClosingTicks, along the tool's x:
// what lies between them is squeezed, and the grip grows with it. While a claim fades out (its
// holder left, fell silent or was taken over) the grasp stays where it last was, whatever becomes
// of the tool's slot. Jaws that are held back follow their hand slowly, and catch up after that.

#include <array>
#include <span>
#include <utility>
#include <vector>

#include "server/tissue/contact/contact_list.h"
#include "server/tissue/hands/claims.h"
#include "server/tissue/hands/tool_table.h"
#include "server/tissue/world/world.h"

namespace trocar::contact {

inline constexpr float kClosingTicks = 100;
// How much thinner tissue is between closed jaws.
inline constexpr float kSqueeze = 0.4f;
// Jaws that were held back come after their hand at 0.5 m/s.
inline constexpr float kCatchUp_m = 0.0005f;

struct Grasp {
  std::vector<NodeIndex> nodes;  // ascending; empty: nothing held
  std::vector<Vec3f> offsets;    // m, tool frame, with the jaws still open
  float grip_n = 0;              // of all nodes together
  float reach_m = 0;             // how far the jaws hold
  float closed = 0;              // 0: jaws open, 1: closed
  bool is_anchored = false;      // fading out: the jaws stay where they are
  bool is_behind = false;        // the jaws are not yet where their hand is
  Pose jaws;                     // world_from_tool
};

// Returns where the jaws hold a node, in the tool's frame.
inline Vec3f held_offset(const Grasp& grasp, std::size_t i) {
  const Vec3f& offset = grasp.offsets[i];
  return {offset.x * (1 - kSqueeze * grasp.closed), offset.y, offset.z};
}

class GraspTable {
 public:
  const Grasp& operator[](ToolSlot slot) const { return grasps_[slot.value]; }
  // O(tools x log(nodes held)).
  bool holds(NodeIndex node) const;

  // Two tools have changed hands.
  void hand_over(ToolSlot from, ToolSlot to) { std::swap(grasps_[from.value], grasps_[to.value]); }

  // Before inputs change a tool: its grasp is going to fade.
  void anchor(ToolSlot slot);
  // After that: jaws go where their hands are. held_back: bits of tools.
  void follow(const hands::ToolTable& tools, std::uint32_t held_back);
  // After the claims were decided: takes hold of what was granted, lets go of what ended.
  void update_holds(const world::World& world, const hands::ToolTable& tools,
                    const hands::ClaimTable& claims, std::span<const hands::ClaimRequest> requests);

  // After the solve: nodes that were pulled beyond their share of the grip have slipped. Lost nodes
  // are free; a grasp without nodes ends its claim.
  void update_slip(const ContactList& contacts, const world::World& world,
                   hands::ClaimTable& claims, std::vector<hands::ClaimEvent>& events);

  // A grasp that holds a node holds its copy, too.
  void add_copy(NodeIndex node, NodeIndex copy);

  void visit_state(world::StateArchive& archive, std::size_t node_count);

 private:
  std::array<Grasp, kMaxTools> grasps_;
};

}  // namespace trocar::contact
