#pragma once

// The blades of a session: which of them cut in this tick, and what hands feel of them.
//
// A blade cuts while its claim is held. The work of opening a wound (Material::cut_energy_j_m2),
// per way that the blade goes, is a force against it; it is smoothed over the last millimetres, for
// wounds open in steps of a part of an element. Tissue that lies against its sides holds it by
// friction: a spring from where it was, which gives way where it would pull harder than the shear
// stress on the sides. So it is smooth at rest, and never gives back more than was put into it:
// with s the spring's length and d the way of a tick, the work k s'.d of the hand is at least
// k/2 (s'^2 - s^2), since s' is s + d or less of that. Where a claim is refused the blade is
// stopped: a hand that goes on feels a spring from there, which lets it back.

#include <array>

#include "server/tissue/hands/claims.h"
#include "server/tissue/hands/tool_table.h"

namespace trocar::blades {

struct Blade {
  bool is_at_work = false;  // its verb is cut; the rest is valid
  bool is_cutting = false, is_stopped = false;
  Vec3f tip;             // m, in the tick before
  Vec3f velocity;        // m/s, smoothed
  float work_per_m = 0;  // N: of cutting, per way
  float side_n = 0;      // what friction on its sides bears at most, smoothed
  float measured_n = 0;  // the same as it was last measured
  Vec3f held;            // m, of friction's spring: from where it pulls nothing to the tip
  Vec3f stop, ahead;     // stopped: where, and towards what, of length 1 or 0
  Vec3f force_n;         // of the tissue on the blade, world frame
};

class BladeTable {
 public:
  const Blade& operator[](ToolSlot tool) const { return blades_[tool.value]; }

  // Before a tick's cut. can_cut: claims are in effect. Returns, as bits, the tools whose blades
  // cut no more, or have appeared elsewhere: they are to be lifted.
  std::uint32_t begin_tick(const hands::ToolTable& tools, const hands::ClaimTable& claims,
                           bool can_cut);
  // Sets the most that friction bears on a blade that cuts, N.
  void set_friction(ToolSlot tool, double limit_n) {
    blades_[tool.value].measured_n = static_cast<float>(limit_n);
  }
  // Ends a tick after its cut. work_j: of all blades; each gets a share in proportion to its way.
  void end_tick(const hands::ToolTable& tools, double work_j);
  void clear() { blades_ = {}; }

  void visit_state(world::StateArchive& archive);

 private:
  // Nobody's hand goes that fast: it has appeared there, and what lies between is not cut.
  static bool has_jumped(const Blade& blade, const Vec3f& tip);
  static void update_force(Blade& blade, const Vec3f& tip, float work_j);
  static Vec3f friction_n(Blade& blade, const Vec3f& moved);

  std::array<Blade, kMaxTools> blades_;
};

}  // namespace trocar::blades
