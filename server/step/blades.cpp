#include "server/step/blades.h"

#include <algorithm>
#include <cmath>

#include "server/contact/contact_finder.h"

namespace trocar::step {
namespace {

// The way over which the wound's work is counted, and how much of the blade's direction is that of
// the newest tick.
constexpr float kWay_m = 0.005f, kNewest = 0.05f;
// A blade this slow or slower feels in proportion less: one that stands feels nothing.
constexpr float kSlow_m_s = 0.002f;
constexpr float kMostForce_n = 30;
// Of a stopped blade, N/m: 10 mm on, 5 N.
constexpr float kStop_n_m = 500, kMostStop_n = 10;

}  // namespace

bool BladeTable::has_jumped(const Blade& blade, const Vec3f& tip) {
  return length(tip - blade.tip) > contact::kJump_m;
}

void BladeTable::end_tick(const input::ToolTable& tools, double work_j) {
  float total = 0;
  for (std::uint8_t i = 0; i < kMaxTools; ++i)
    if (blades_[i].is_cutting) total += length(tools[ToolSlot{i}].pose.position - blades_[i].tip);
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    Blade& blade = blades_[i];
    if (!blade.is_at_work) continue;
    const Vec3f tip = tools[ToolSlot{i}].pose.position;
    const float share = blade.is_cutting && total > 0 ? length(tip - blade.tip) / total : 0;
    follow(blade, tip, static_cast<float>(work_j) * share);
  }
}

void BladeTable::follow(Blade& blade, const Vec3f& tip, float work_j) {
  const Vec3f moved = tip - blade.tip;
  blade.tip = tip;
  blade.velocity += (moved / kTickSeconds - blade.velocity) * kNewest;
  blade.force_n = {};
  if (blade.is_stopped) {
    const float beyond = std::max(0.0f, dot(tip - blade.stop, blade.ahead));
    blade.force_n = blade.ahead * -std::min(kStop_n_m * beyond, kMostStop_n);
    return;
  }
  blade.work_per_m += (work_j - blade.work_per_m * length(moved)) / kWay_m;
  blade.work_per_m = std::max(0.0f, blade.work_per_m);
  const float speed = length(blade.velocity);
  const float force = std::min(blade.work_per_m, kMostForce_n) * std::min(1.0f, speed / kSlow_m_s);
  if (speed > 0) blade.force_n = blade.velocity * (-force / speed);
}

void BladeTable::visit_state(world::StateArchive& archive) {
  for (auto& blade : blades_) {
    archive.flag(blade.is_at_work);
    if (!blade.is_at_work) continue;
    archive.flag(blade.is_cutting);
    archive.flag(blade.is_stopped);
    archive.value(blade.work_per_m);
    for (auto* vector : {&blade.tip, &blade.velocity, &blade.stop, &blade.ahead, &blade.force_n}) {
      archive.value(*vector);
      if (archive.is_reading() && !is_finite(*vector)) archive.fail();
    }
    if (archive.is_reading() && !std::isfinite(blade.work_per_m)) archive.fail();
  }
}

}  // namespace trocar::step
