#pragma once

// A pushing tool's proxy: the tool as the tissue sees it (the god-object of Zilles & Salisbury
// 1995, for a tool with a volume as in Ruspini 1997, on tissue that yields). It walks to where the
// hand is, at most so far per tick, and never through a face it has not pushed ahead of it. After
// each tick it stands as near to the hand as the surface then lets it: outside. What a hand feels
// is `force_n` and `torque_nm`, the sum of what the surface does to the tool on its way there.
//
// The proxy also keeps where friction holds each touched point: an anchor in the tool's frame,
// dragged along where the point slides.

#include <array>
#include <utility>
#include <vector>

#include "server/tissue/contact/contact_list.h"
#include "server/tissue/hands/tool_table.h"
#include "server/tissue/world/state_archive.h"

namespace trocar::contact {

struct Proxy {
  bool is_placed = false;  // false: the tool pushes nothing, and will appear where the hand is
  Pose pose;               // world_from_tool
  Pose hand;               // where the hand was in the last tick
  float step_m = 0;        // how far it may walk in the next
  std::vector<std::uint32_t> point_ids;  // quadrature points pressed, ascending
  std::vector<Vec3f> anchors;            // m, tool frame; per point

  bool presses() const { return !point_ids.empty(); }
};

// The tissue acts on the tool with this force and torque, in the world frame.
struct Reaction {
  Vec3f force_n;
  Vec3f torque_nm;          // about the tip
  float penetration_m = 0;  // deepest that a point is inside the tool; 0 for a grasp
};
Reaction reaction_on(const ContactList& contacts, const ToolContact& tool,
                     const world::World& world);

// Planes with points behind them, as arrays for a quick look at the deepest. No allocation once it
// has had as many.
class PlaneArrays {
 public:
  static constexpr std::size_t kNone = ~std::size_t{0};
  struct Deepest {
    std::size_t point = kNone;
    float depth = 0;
  };

  void clear() { count_ = 0; }
  // at: of the point, from its plane.
  void add(const Vec3f& normal, const Vec3f& at);
  Vec3f normal(std::size_t point) const;
  // When all planes have moved; the first of equals, kNone where none is deeper than at_least.
  Deepest deepest(const Vec3f& moved, float at_least) const;

 private:
  static constexpr std::size_t kAtOnce = 8;
  struct Block {
    std::array<float, kAtOnce> normal_x{}, normal_y{}, normal_z{}, x{}, y{}, z{};
  };

  std::size_t count_ = 0;
  std::vector<Block> blocks_;
};

class ProxyTable {
 public:
  const Proxy& operator[](ToolSlot slot) const { return proxies_[slot.value]; }

  // After the solve: proxies go where the surface lets them, anchors follow what slid. Tools that
  // do not push lose theirs.
  void update(const ContactList& contacts, const world::World& world,
              const hands::ToolTable& tools);

  // Two tools have changed hands.
  void hand_over(ToolSlot from, ToolSlot to) {
    std::swap(proxies_[from.value], proxies_[to.value]);
  }

  void visit_state(world::StateArchive& archive);

 private:
  std::array<Proxy, kMaxTools> proxies_;
  PlaneArrays planes_;  // scratch
};

}  // namespace trocar::contact
