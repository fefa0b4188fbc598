#pragma once

// Who holds or touches which part of the surface, for an overlay. The server names the tools whose
// claims are in effect, not the nodes; which those are follows from the server's rule on the same
// surface:
//
//   grasp  the vertices within the tool's reach when the claim came into effect, until it ends;
//          one that has come out of the jaws by kLostBeyond reaches has slipped and is left out
//   push   the vertices within kTouchMargin_m of the tool where the tissue lets it be
//
// A client that joined during a grasp sees what is in reach then. Thread: render thread.

#include <array>
#include <span>
#include <vector>

#include "client/replica/session_view.h"

namespace trocar::replica {

inline constexpr std::uint8_t kHeldByNobody = 0xff;

struct Holding {
  std::uint8_t owner = kHeldByNobody;  // participant slot
  bool is_grasp = false;               // held exclusively; else touched by a push

  bool operator==(const Holding&) const = default;
};

class HeldTissue {
 public:
  static constexpr float kTouchMargin_m = 0.004f;
  static constexpr float kLostBeyond = 1.5f;

  // `positions` m, per vertex slot; `shapes` per tool, as in `tools`.
  void update(std::span<const Vec3f> positions, std::span<const Tool> tools,
              std::span<const tool::ToolShape> shapes);
  // After the surface was replaced or time went back.
  void clear();

  const std::vector<Holding>& holdings() const { return holdings_; }  // per vertex slot

 private:
  struct Grasp {
    bool is_held = false;
    std::vector<std::uint32_t> vertices;
  };
  std::array<Grasp, kMaxTools> grasps_;
  std::vector<Holding> holdings_;
};

}  // namespace trocar::replica
