#pragma once

// The blades of a session: which of them cut in this tick, and what hands feel of them.
//
// A blade cuts while its claim is held, and feels what edge_force.h says. Where a claim is refused,
// or while it is to wait, the blade is stopped: a hand that goes on feels a spring from there,
// which lets it back. What it has planned by then is cut; after that it begins anew, where it is.
// A hand feels nothing of what scissors cut: their closing does that work.
//
// The force follows by at most kMostStep_n in a tick where one of these ends and another begins,
// and after a blade is lifted.

#include <array>

#include "server/tissue/blades/edge_force.h"
#include "server/tissue/hands/claims.h"
#include "server/tissue/hands/tool_table.h"

namespace trocar::blades {

// No hand feels a force that changes faster, N in a tick.
inline constexpr float kMostStep_n = 0.3f;

struct Blade {
  bool is_at_work = false;  // its verb is cut; the rest is valid
  bool is_cutting = false, is_stopped = false;
  EdgeForce edge;
  Vec3f stop, ahead;  // stopped: where the tip was, and towards what, of length 1 or 0
  Wrench felt;

  // Closing scissors meet nothing; they cut.
  bool is_in_tissue() const { return is_at_work && is_cutting && edge.meets_tissue(); }
  bool is_felt() const {
    return length_squared(felt.force_n) > 0 || length_squared(felt.torque_nm) > 0;
  }
};

// The hand does this part of the work that opens a wound; an energised edge burns its way.
inline float hands_share(tool::Form form) {
  return form == tool::Form::Hook ? 0.1f : 1.0f;
}

// The wound that a blade has opened in a tick.
struct BladeWound {
  float energy_j = 0;  // by Material::cut_energy_j_m2
  float h_m = 0;       // length of elements there
};

class BladeTable {
 public:
  struct Hands {
    const hands::ToolTable& tools;
    const hands::ClaimTable& claims;
    std::uint32_t waiting = 0;  // bits of tools whose blades are to wait
  };

  const Blade& operator[](ToolSlot tool) const { return blades_[tool.value]; }

  // Before a tick's cut. can_cut: claims are in effect. Returns, as bits, the tools whose blades
  // cut no more, or have appeared elsewhere: they are to be lifted.
  std::uint32_t begin_tick(const Hands& hands, bool can_cut);
  // Says what tissue the edge of a blade that cuts meets. breadth_m: of both its sides together.
  void look(ToolSlot tool, const cutting::EdgeResistance& resistance, double breadth_m) {
    blades_[tool.value].edge.look(resistance, breadth_m);
  }
  // Ends a tick after its cut.
  void end_tick(const hands::ToolTable& tools, const std::array<BladeWound, kMaxTools>& wounds);
  void clear() { blades_ = {}; }

  void visit_state(world::StateArchive& archive);

  // Nobody's hand goes that fast: it has appeared there, and what lies between is not cut.
  static bool has_jumped(const Blade& blade, const EdgeEnds& ends);

 private:
  static Vec3f stop_n(const Blade& blade);

  std::array<Blade, kMaxTools> blades_;
};

}  // namespace trocar::blades
