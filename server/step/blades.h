#pragma once

// The blades of a session: which of them cut in this tick, and what hands feel of them.
//
// A blade cuts while its claim is held. The work of opening a wound (Material::cut_energy_j_m2),
// per way that the blade goes, is a force against it; it is smoothed over the last millimetres, for
// wounds open in steps of a part of an element. Where a claim is refused the blade is stopped: a
// hand that goes on feels a spring from there, which lets it back.

#include <array>

#include "server/input/tool_table.h"
#include "server/locks/claims.h"

namespace trocar::step {

struct Blade {
  bool is_at_work = false;  // its verb is cut; the rest is valid
  bool is_cutting = false, is_stopped = false;
  Vec3f tip;             // m, in the tick before
  Vec3f velocity;        // m/s, smoothed
  float work_per_m = 0;  // N: of cutting, per way
  Vec3f stop, ahead;     // stopped: where, and towards what, of length 1 or 0
  Vec3f force_n;         // of the tissue on the blade, world frame
};

class BladeTable {
 public:
  const Blade& operator[](ToolSlot tool) const { return blades_[tool.value]; }

  // Before a tick's cut. can_cut: claims are in effect. Calls lift(tool) for blades that cut no
  // more, or have appeared elsewhere.
  template <typename Lift>
  void begin_tick(const input::ToolTable& tools, const locks::ClaimTable& claims, bool can_cut,
                  Lift&& lift);
  // After it. work_j: of all blades; each gets its share by how far it went.
  void end_tick(const input::ToolTable& tools, double work_j);
  void clear() { blades_ = {}; }

  void visit_state(world::StateArchive& archive);

 private:
  // Nobody's hand goes that fast: it has appeared there, and what lies between is not cut.
  static bool has_jumped(const Blade& blade, const Vec3f& tip);
  void follow(Blade& blade, const Vec3f& tip, float work_j);

  std::array<Blade, kMaxTools> blades_;
};

template <typename Lift>
void BladeTable::begin_tick(const input::ToolTable& tools, const locks::ClaimTable& claims,
                            bool can_cut, Lift&& lift) {
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const auto& tool = tools[ToolSlot{i}];
    const auto& claim = claims.claim(ToolSlot{i});
    Blade& blade = blades_[i];
    const auto& tip = tool.pose.position;
    const bool is_held = claim.phase == locks::ClaimPhase::Held;
    const bool is_at_work = tool.has_sample && claim.verb == scene::Verb::Cut &&
                            (is_held || claim.phase == locks::ClaimPhase::Wanted);
    const bool is_cutting = is_at_work && is_held && can_cut;
    const bool is_stopped =
        is_at_work && !is_held && claim.last_refusal == locks::ClaimOutcome::RefusedHeld;
    const bool is_new = !blade.is_at_work || has_jumped(blade, tip);
    if (blade.is_cutting && (!is_cutting || is_new)) lift(ToolSlot{i});
    if (!is_at_work || is_new) blade = {.tip = tip};
    if (is_stopped && !blade.is_stopped) {
      blade.stop = blade.tip;
      blade.ahead = normalized(blade.velocity, {});
      blade.work_per_m = 0;
    }
    blade.is_at_work = is_at_work;
    blade.is_cutting = is_cutting;
    blade.is_stopped = is_stopped;
  }
}

}  // namespace trocar::step
