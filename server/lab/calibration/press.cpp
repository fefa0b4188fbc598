#include "server/lab/calibration/press.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"
#include "server/session/control/depth_chooser.h"

namespace trocar::calibration {
namespace {

// From above the surface, where the tip meets it at its speed and not by appearing.
constexpr double kStart_m = 0.001;

}  // namespace

PressBench::PressBench(const organ::Organ& organ, unsigned workers) : simulation_(organ, workers) {
  simulation_.write_snapshot(rest_);
}

PressCourse PressBench::press(const Place& place, const PressPlan& plan, const Decide& decide) {
  return run(place, plan, decide, [](const step::TickReport&, const Vec3d&) {});
}

PressCourse PressBench::run(const Place& place, const PressPlan& plan, const Decide& decide,
                            const Observe& observe) {
  const auto restored = simulation_.restore_snapshot(rest_);
  TROCAR_ASSERT(restored.ok());
  const auto moving = static_cast<Tick>(
      std::ceil((kStart_m + plan.depth_m) / plan.speed_m_s / static_cast<double>(kTickSeconds)));
  // The shaft is as short as can be, so that nothing but the tip touches.
  const auto radius = static_cast<float>(plan.radius_m);
  hands::TickInputs inputs;
  hands::HandJoin join{.slot = {0}};
  join.shapes[0] = {.radius_m = radius, .length_m = std::max(0.01f, 2 * radius)};
  inputs.joins.push_back(join);
  const Quatf orientation = rotation_from_z(place.outward);
  const Vec3f sideways = rotate(orientation, {1, 0, 0});

  PressCourse course;
  std::vector<double> forces;
  for (Tick tick = 1; tick <= moving + plan.hold_ticks; ++tick) {
    const double way =
        std::min(kStart_m + plan.depth_m, static_cast<double>(std::min(tick, moving)) *
                                              plan.speed_m_s * static_cast<double>(kTickSeconds));
    const auto out = static_cast<float>(kStart_m - way);
    const Vec3f tip =
        place.position + place.outward * out + sideways * (static_cast<float>(plan.slant * way));
    inputs.samples.push_back({tool_slot({0}, 0), {{tip, orientation}, tool::Verb::Push}});
    const auto decisions = decide(forces);
    const auto& report = simulation_.tick(inputs, decisions);
    inputs.clear();
    course.convergence.note(report, decisions);
    simulation_.pop_frame();
    control::read_forces(simulation_, forces);
    const auto& context = simulation_.context();
    Vec3d force;
    for (const auto& tool : context.contact.found.tools)
      force += to_double(
          contact::reaction_on(context.contact.found, tool, simulation_.state().world).force_n);
    observe(report, force);
    course.forces_n.push_back(force);
    course.queue_nodes.push_back(report.near.queue_nodes);
    course.queue_depths.push_back(
        static_cast<std::uint32_t>(std::max<std::size_t>(1, context.near.queue.layer_count()) - 1));
    ++ticks_;
  }
  return course;
}

PressCourse PressBench::press(const Place& place, const PressPlan& plan,
                              const step::TickDecisions& decisions) {
  return press(place, plan, [&](std::span<const double>) { return decisions; });
}

Pilot PressBench::pilot(const Place& place, const PressPlan& plan) {
  Pilot pilot;
  Tick tick = 0;
  run(
      place, plan, [&](std::span<const double>) { return Pilot::decisions(++tick); },
      [&](const step::TickReport& report, const Vec3d& force_n) {
        pilot.note(report, length(force_n));
      });
  return pilot;
}

}  // namespace trocar::calibration
