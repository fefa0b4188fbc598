#include "tests/feel/felt_organ.h"

#include "server/tissue/contact/proxies.h"

namespace trocar::haptics::testing {
namespace {

const ToolSlot kTool = tool_slot({0}, 0);
constexpr double kStep_m = 1e-4, kFarthest_m = 0.2;
constexpr double kTouch_n = 0.002;

}  // namespace

FeltOrgan::FeltOrgan(const step::Simulation& simulation, const tool::ToolShape& shape)
    : simulation_(simulation.beside()) {
  hands::HandJoin join{.slot = {0}};
  join.shapes[0] = shape;
  inputs_.joins.push_back(join);
}

const hands::Tool& FeltOrgan::tool() const {
  return simulation_.state().tools[kTool];
}

void FeltOrgan::tick(const ToolReading* reading, const Given& given) {
  if (reading) {
    const tool::ToolSample sample{{to_float(reading->tip_m), reading->orientation}, reading->verb};
    const hands::ToolInput wanted{kTool, sample, reading->time_us};
    if (const auto input = given ? given(wanted) : wanted) inputs_.samples.push_back(*input);
  }
  simulation_.tick(inputs_, decisions_);
  inputs_.clear();
}

void FeltOrgan::tick_at(const ToolReading& reading) {
  ToolReading target = reading;
  target.time_us = 0;  // no patch is asked for
  if (tool().has_sample) {
    // It goes a part of the way in a tick: it is sent as much too far.
    const Vec3d at_m = to_double(tool().pose.position);
    target.tip_m = at_m + (reading.tip_m - at_m) * static_cast<double>(hands::kPoseTicks);
  }
  tick(&target);
}

Vec3d FeltOrgan::force_n() const {
  const auto& state = simulation_.state();
  Vec3d force = to_double(state.cuts.felt(kTool).force_n);
  const auto& found = simulation_.context().contact.found;
  for (const auto& contact : found.tools)
    if (contact.tool == kTool)
      force += to_double(contact::reaction_on(found, contact, state.world).force_n);
  return force;
}

std::optional<wire::HapticPatch> FeltOrgan::pop_patch() {
  const auto frame = simulation_.pop_frame();
  if (!frame) return std::nullopt;
  for (const auto& each : frame->tools) {
    if (each.tool != kTool || each.touch.echo_time_us == 0) continue;
    wire::HapticPatch patch = each.touch;
    patch.sequence = ++sequence_;
    return patch;
  }
  return std::nullopt;
}

std::optional<Vec3d> place_of_contact(const step::Simulation& simulation,
                                      const tool::ToolShape& shape, const Vec3d& from_m,
                                      const Vec3d& way) {
  FeltOrgan organ(simulation, shape);
  const Quatf orientation = rotation_from_z(to_float(-way));
  for (double far_m = 0; far_m < kFarthest_m; far_m += kStep_m) {
    const Vec3d tip_m = from_m + way * far_m;
    organ.tick_at({.tip_m = tip_m, .orientation = orientation});
    if (length(organ.force_n()) > kTouch_n) return tip_m;
  }
  return std::nullopt;
}

}  // namespace trocar::haptics::testing
