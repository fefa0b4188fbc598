#include "server/tissue/blades/blades.h"

#include <algorithm>
#include <cmath>

namespace trocar::blades {
namespace {

// A stopped blade is held by a spring of this stiffness, N/m, up to this force, N: 5 N at 10 mm.
constexpr float kStop_n_m = 500, kMostStop_n = 10;
// In a tick, of either end of an edge: 5 m/s.
constexpr float kFastest_m = 0.005f;

// Force and torque go the same part of the way, so that the force keeps its lever.
Wrench followed(const Wrench& felt, const Wrench& wanted) {
  const Vec3f force = wanted.force_n - felt.force_n, torque = wanted.torque_nm - felt.torque_nm;
  const float step_n = length(force);
  if (step_n <= kMostStep_n) return wanted;
  const float part = kMostStep_n / step_n;
  return {felt.force_n + force * part, felt.torque_nm + torque * part};
}

}  // namespace

bool BladeTable::has_jumped(const Blade& blade, const EdgeEnds& ends) {
  const auto& before = blade.edge.ends();
  return std::max(length(ends[0] - before[0]), length(ends[1] - before[1])) > kFastest_m;
}

std::uint32_t BladeTable::begin_tick(const Hands& hands, bool can_cut) {
  static_assert(kMaxTools <= 32);
  std::uint32_t lifted = 0;
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const auto& tool = hands.tools[ToolSlot{i}];
    const auto& claim = hands.claims.claim(ToolSlot{i});
    Blade& blade = blades_[i];
    const bool is_held = claim.phase == hands::ClaimPhase::Held;
    const bool is_at_work = tool.has_sample && claim.verb == tool::Verb::Cut &&
                            (is_held || claim.phase == hands::ClaimPhase::Wanted);
    if (!is_at_work && !blade.is_at_work) continue;
    const bool waits = (hands.waiting >> i & 1) != 0;
    const bool is_cutting = is_at_work && is_held && can_cut && !waits && hands::can_cut(tool);
    const bool is_stopped =
        is_at_work && (is_held ? waits : claim.last_refusal == hands::ClaimOutcome::RefusedHeld);
    const bool is_new = !blade.is_at_work || has_jumped(blade, hands::edge_of(tool));
    if (blade.is_cutting && (!is_cutting || is_new)) lifted |= 1u << i;
    if (!is_at_work || is_new)
      blade = {.edge = EdgeForce(hands::edge_of(tool)), .felt = blade.felt};
    if (is_stopped && !blade.is_stopped) {
      blade.stop = blade.edge.ends()[0];
      blade.ahead = blade.edge.direction();
    }
    if (blade.is_cutting && !is_cutting) blade.edge.look_away();
    blade.is_at_work = is_at_work;
    blade.is_cutting = is_cutting;
    blade.is_stopped = is_stopped;
  }
  return lifted;
}

void BladeTable::end_tick(const hands::ToolTable& tools,
                          const std::array<BladeWound, kMaxTools>& wounds) {
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    Blade& blade = blades_[i];
    if (!blade.is_at_work) {
      if (blade.is_felt()) blade.felt = followed(blade.felt, {});
      continue;
    }
    const auto ends = hands::edge_of(tools[ToolSlot{i}]);
    Wrench wanted;
    if (blade.is_stopped) {
      blade.edge.rest(ends);
      wanted.force_n = stop_n(blade);
    } else if (tools[ToolSlot{i}].shape.form == tool::Form::Scissors) {
      blade.edge.rest(ends);
    } else {
      const float share = hands_share(tools[ToolSlot{i}].shape.form);
      wanted = blade.edge.move(ends, share * wounds[i].energy_j, wounds[i].h_m);
    }
    blade.felt = followed(blade.felt, wanted);
  }
}

Vec3f BladeTable::stop_n(const Blade& blade) {
  const float beyond = std::max(0.0f, dot(blade.edge.ends()[0] - blade.stop, blade.ahead));
  return blade.ahead * -std::min(kStop_n_m * beyond, kMostStop_n);
}

void BladeTable::visit_state(world::StateArchive& archive) {
  const auto vector = [&](Vec3f& value) {
    archive.value(value);
    if (archive.is_reading() && !is_finite(value)) archive.fail();
  };
  for (auto& blade : blades_) {
    bool is_felt = blade.is_felt();
    archive.flag(is_felt);
    if (is_felt)
      for (auto* felt : {&blade.felt.force_n, &blade.felt.torque_nm}) vector(*felt);
    archive.flag(blade.is_at_work);
    if (!blade.is_at_work) continue;
    archive.flag(blade.is_cutting);
    archive.flag(blade.is_stopped);
    blade.edge.visit_state(archive);
    for (auto* of_stop : {&blade.stop, &blade.ahead}) vector(*of_stop);
  }
}

}  // namespace trocar::blades
