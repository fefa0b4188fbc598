#include "server/tissue/blades/blades.h"

#include <algorithm>
#include <cmath>

#include "server/tissue/contact/contact_finder.h"

namespace trocar::blades {
namespace {

// The work of cutting is averaged over kWay_m of a blade's way. kNewest is the weight of the newest
// tick in smoothed velocities and forces.
constexpr float kWay_m = 0.005f, kNewest = 0.05f;
// A blade this slow or slower feels in proportion less: one that stands feels nothing.
constexpr float kSlow_m_s = 0.002f;
constexpr float kMostForce_n = 30;
// Fading friction below this force counts as none.
constexpr float kLeastForce_n = 1e-3f;
// The friction spring bears 1 N at 1 mm.
constexpr float kFriction_n_m = 1000;
// A stopped blade is held by a spring of this stiffness, N/m, up to this force, N: 5 N at 10 mm.
constexpr float kStop_n_m = 500, kMostStop_n = 10;

}  // namespace

bool BladeTable::has_jumped(const Blade& blade, const Vec3f& tip) {
  return length(tip - blade.tip) > contact::kJump_m;
}

std::uint32_t BladeTable::begin_tick(const hands::ToolTable& tools, const hands::ClaimTable& claims,
                                     bool can_cut) {
  static_assert(kMaxTools <= 32);
  std::uint32_t lifted = 0;
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const auto& tool = tools[ToolSlot{i}];
    const auto& claim = claims.claim(ToolSlot{i});
    Blade& blade = blades_[i];
    const auto& tip = tool.pose.position;
    const bool is_held = claim.phase == hands::ClaimPhase::Held;
    const bool is_at_work = tool.has_sample && claim.verb == tool::Verb::Cut &&
                            (is_held || claim.phase == hands::ClaimPhase::Wanted);
    const bool is_cutting = is_at_work && is_held && can_cut;
    const bool is_stopped =
        is_at_work && !is_held && claim.last_refusal == hands::ClaimOutcome::RefusedHeld;
    const bool is_new = !blade.is_at_work || has_jumped(blade, tip);
    if (blade.is_cutting && (!is_cutting || is_new)) lifted |= 1u << i;
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
  return lifted;
}

void BladeTable::end_tick(const hands::ToolTable& tools, double work_j) {
  float total = 0;
  for (std::uint8_t i = 0; i < kMaxTools; ++i)
    if (blades_[i].is_cutting) total += length(tools[ToolSlot{i}].pose.position - blades_[i].tip);
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    Blade& blade = blades_[i];
    if (!blade.is_at_work) continue;
    const Vec3f tip = tools[ToolSlot{i}].pose.position;
    const float share = blade.is_cutting && total > 0 ? length(tip - blade.tip) / total : 0;
    update_force(blade, tip, static_cast<float>(work_j) * share);
  }
}

// A spring of one stiffness, whatever it may bear: its energy changes by its length alone.
Vec3f BladeTable::friction_n(Blade& blade, const Vec3f& moved) {
  if (!blade.is_cutting) blade.measured_n = 0;
  blade.side_n += (std::min(blade.measured_n, kMostForce_n) - blade.side_n) * kNewest;
  if (blade.measured_n == 0 && blade.side_n < kLeastForce_n) blade.side_n = 0;
  blade.held += moved;
  const float pull = kFriction_n_m * length(blade.held);
  if (pull > blade.side_n) blade.held = blade.held * (blade.side_n / pull);
  return blade.held * -kFriction_n_m;
}

void BladeTable::update_force(Blade& blade, const Vec3f& tip, float work_j) {
  const Vec3f moved = tip - blade.tip;
  blade.tip = tip;
  blade.velocity += (moved / kTickSeconds - blade.velocity) * kNewest;
  blade.force_n = {};
  if (blade.is_stopped) {
    const float beyond = std::max(0.0f, dot(tip - blade.stop, blade.ahead));
    blade.force_n = blade.ahead * -std::min(kStop_n_m * beyond, kMostStop_n);
    blade.held = {};
    blade.side_n = blade.measured_n = 0;
    return;
  }
  blade.work_per_m += (work_j - blade.work_per_m * length(moved)) / kWay_m;
  blade.work_per_m = std::max(0.0f, blade.work_per_m);
  const float speed = length(blade.velocity);
  const float force = std::min(blade.work_per_m, kMostForce_n) * std::min(1.0f, speed / kSlow_m_s);
  if (speed > 0) blade.force_n = blade.velocity * (-force / speed);
  blade.force_n += friction_n(blade, moved);
}

void BladeTable::visit_state(world::StateArchive& archive) {
  for (auto& blade : blades_) {
    archive.flag(blade.is_at_work);
    if (!blade.is_at_work) continue;
    archive.flag(blade.is_cutting);
    archive.flag(blade.is_stopped);
    for (auto* number : {&blade.work_per_m, &blade.side_n, &blade.measured_n}) {
      archive.value(*number);
      if (archive.is_reading() && !(*number >= 0 && std::isfinite(*number))) archive.fail();
    }
    for (auto* vector :
         {&blade.tip, &blade.velocity, &blade.held, &blade.stop, &blade.ahead, &blade.force_n}) {
      archive.value(*vector);
      if (archive.is_reading() && !is_finite(*vector)) archive.fail();
    }
  }
}

}  // namespace trocar::blades
