#include "tests/bleeding/cut_liver.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/organs/catalogue/builtin_organs.h"
#include "tests/support/random.h"

namespace trocar::bleeding::testing {

void cut_liver(std::uint64_t seed, Tick ticks, const Observe& observe, const Prepare& prepare) {
  step::Simulation simulation(*catalogue::make_liver(800), 1, {.bleeding = Rules{}});
  trocar::testing::Random random(seed);
  Vec3f top{0, -1, 0};
  for (const auto& p : simulation.organ().mesh.rest_positions)
    if (static_cast<float>(p.y) > top.y) top = to_float(p);
  hands::TickInputs inputs;
  const tool::ToolShape scalpel{
      .radius_m = 0.0015f, .length_m = 0.2f, .edge_m = 0.06f, .form = tool::Form::Scalpel};
  const tool::ToolShape suction{.reach_m = 0.03f, .form = tool::Form::Suction};
  inputs.joins.push_back({.slot = {0}, .tool_count = 2, .shapes = {scalpel, suction}});
  const auto between = [&](float least, float most) {
    return least + (most - least) * static_cast<float>(random.below(1000)) * 1e-3f;
  };
  Vec3f from, to;
  for (Tick tick = 1; tick <= ticks; ++tick) {
    const Tick phase = (tick - 1) % 500;
    if (phase == 0) {
      from = top + Vec3f{between(-0.05f, 0.05f), between(-0.04f, -0.02f), between(-0.04f, 0.04f)};
      to = from + Vec3f{between(-0.06f, 0.06f), between(-0.01f, 0.01f), between(-0.03f, 0.03f)};
    }
    if (tick % 8 == 1) {
      // It comes from above, goes along, and lifts.
      const float t = static_cast<float>(phase) / 500;
      const float lifted = std::max({0.0f, 0.15f - t, t - 0.85f}) * 0.5f;
      const float along = std::clamp((t - 0.15f) / 0.7f, 0.0f, 1.0f);
      const Pose pose{from * (1 - along) + to * along + Vec3f{0, lifted, 0},
                      rotation_from_z({0, 1, 0})};
      inputs.samples.push_back({tool_slot({0}, 0), {pose, tool::Verb::Cut}, 0});
      const Pose beside{pose.position + Vec3f{0, 0.03f, 0}, pose.orientation};
      inputs.samples.push_back({tool_slot({0}, 1), {beside, tool::Verb::Push}, 0});
    }
    if (prepare) prepare(tick, inputs);
    simulation.tick(inputs, {});
    inputs.clear();
    if (auto frame = simulation.pop_frame()) observe(*frame, simulation);
  }
}

}  // namespace trocar::bleeding::testing
