#pragma once

// Two scripted hands for tests: one presses and slides, the other grasps and lifts. On Choi's
// lattice both find tissue; elsewhere the first does.

#include <algorithm>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/simulation.h"

namespace trocar::step::testing {

// The first hand presses here, relative to the place that both hands are given, m.
inline constexpr Vec3f kPressedAt{-0.105f, 0, 0.004f};

// Returns the place for an organ: the middle of the lattice's flat top, or else the place from
// which the first hand comes down on the highest node.
inline Vec3f place_on(const organ::Organ& organ) {
  Vec3d highest{0, -1, 0};
  for (const auto& p : organ.mesh.rest_positions)
    if (p.y > highest.y) highest = p;
  if (organ.name == "lattice") return {0, static_cast<float>(highest.y), 0};
  return to_float(highest) - kPressedAt;
}

// Inputs of tick `tick` (1, 2, ...): joins first, then samples every 8 ticks.
inline void add_two_hands(Tick tick, const Vec3f& place, hands::TickInputs& inputs) {
  if (tick == 1)
    for (std::uint8_t hand = 0; hand < 2; ++hand) {
      hands::HandJoin join{.slot = {hand}};
      join.shapes[0] = {.radius_m = 0.012f, .length_m = 0.3f, .reach_m = 0.012f};
      inputs.joins.push_back(join);
    }
  if (tick % 8 != 1) return;
  const float t = static_cast<float>(tick) * 1e-3f;
  const auto add = [&](std::uint8_t hand, const Vec3f& tip, tool::Verb verb) {
    inputs.samples.push_back(
        {tool_slot({hand}, 0), {{place + tip, rotation_from_z({0, 1, 0})}, verb}});
  };
  const float press = std::min(0.01f, 0.05f * t);
  add(0, kPressedAt + Vec3f{0.06f * t, -press, 0}, tool::Verb::Push);
  add(1, {0.04f, std::min(0.02f, 0.04f * t), 0.003f},
      t < 1.2f ? tool::Verb::Grasp : tool::Verb::None);
}

}  // namespace trocar::step::testing
