#include "server/tissue/bleeding/instruments.h"

#include <algorithm>
#include <numbers>

namespace trocar::bleeding {
namespace {

// A vertex this far beside a tip is still under it: tissue is pressed there, too.
constexpr double kBesideM = 0.003;
constexpr double kHookSealsM = 0.004;  // around the tip of an energised hook

bool is_near(const Vec3d& a, const Vec3d& b, double reach_m) {
  return length_squared(a - b) <= reach_m * reach_m;
}

}  // namespace

void Instruments::read(std::span<const ToolAtWork> tools) {
  presses.clear(), suctions.clear(), coagulators.clear(), clippers.clear();
  for (const auto& [slot, shape, verb, tip, force_n] : tools) {
    const double radius = shape.radius_m, half_width = shape.half_width_m, reach = shape.reach_m;
    const bool is_used = verb == tool::Verb::Push;
    if (is_used && shape.form == tool::Form::Suction) suctions.push_back({tip, reach, slot.value});
    if (is_used && shape.form == tool::Form::Coagulator)
      coagulators.push_back({tip, reach, slot.value});
    if (verb == tool::Verb::Cut && shape.form == tool::Form::Hook)
      coagulators.push_back({tip, kHookSealsM, slot.value});
    if (verb == tool::Verb::Grasp && shape.form == tool::Form::Clipper)
      clippers.push_back({tip, reach, slot.value});
    const bool holds_or_cuts = verb == tool::Verb::Grasp || verb == tool::Verb::Cut;
    if (holds_or_cuts || force_n == 0) continue;
    const double area = std::numbers::pi * radius * radius + 4 * radius * half_width;
    presses.push_back({tip, radius + half_width + kBesideM, force_n / area});
  }
}

bool Instruments::is_pressed(const Vec3d& place_m, double pressure_pa) const {
  return std::ranges::any_of(presses, [&](const Press& press) {
    return press.pressure_pa >= pressure_pa && is_near(place_m, press.tip_m, press.reach_m);
  });
}

bool Instruments::is_coagulated(const Vec3d& place_m) const {
  return std::ranges::any_of(coagulators, [&](const Touch& touch) {
    return is_near(place_m, touch.tip_m, touch.reach_m);
  });
}

}  // namespace trocar::bleeding
