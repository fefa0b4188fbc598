#pragma once

// The threads of a session as arrays: state of the tick. Nodes of all threads stand in a row, in
// the order of the rules; nodes are never added or removed, and a cut parts two that were joined.
// SI units, world frame.

#include <cstdint>
#include <vector>

#include "common/base/ids.h"
#include "common/math/vec3.h"
#include "server/tissue/thread/rules.h"
#include "server/tissue/world/state_archive.h"

namespace trocar::thread {

inline constexpr std::uint32_t kMostPairs = 256;
inline constexpr std::uint32_t kMostHeld = 16 * kMaxTools;
inline constexpr std::uint8_t kTouchesNothing = 0xff;

// Two segments of thread that touch, or are about to.
struct Pairs {
  std::vector<std::uint32_t> first, second;       // the nodes where they begin
  std::vector<double> place_first, place_second;  // 0 to 1 along them
  std::vector<double> press_n;                    // of one on the other
  std::vector<Vec3d> creeps_m;                    // friction's elastic slip
};

// Nodes that jaws hold, by tool.
struct Holds {
  std::vector<std::uint32_t> nodes;  // distinct
  std::vector<ToolSlot> tools;
  std::vector<Vec3d> offsets_m;  // tool frame
};

struct Threads {
  explicit Threads(const Rules& rules);

  std::size_t node_count() const { return places_m.size(); }

  // Per node.
  std::vector<Vec3d> places_m, velocities_m_s;
  std::vector<double> tensions_n;        // of the segment to the next node; 0 where there is none
  std::vector<std::uint8_t> is_joined;   // to the next node
  std::vector<std::uint8_t> touched;     // what of the scene it touches: kTouchesNothing, or which
  std::vector<Vec3d> creeps_m;           // friction's elastic slip there
  std::vector<std::uint8_t> overloaded;  // ticks in which the segment to the next node was so
  Pairs pairs;
  Holds holds;
  std::vector<std::uint8_t> was_closed;  // per tool: its jaws were closed in the tick before
  std::vector<Pose> tool_poses;          // per tool, of the tick before
  std::vector<std::uint8_t> has_pose;    // per tool

  // The threads of a mark that was returned to: tools that hold something now have to open first.
  void let_go(const Threads& now);
  // Two tools have changed hands, with what they hold.
  void hand_over(ToolSlot from, ToolSlot to);

  void visit_state(world::StateArchive& archive);

 private:
  bool is_whole() const;
};

}  // namespace trocar::thread
