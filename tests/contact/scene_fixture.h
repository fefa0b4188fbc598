#pragma once

// A small organ and hands that are moved by hand: the tools are where they are told to be, tick by
// tick, through the session's own inputs.

#include <array>
#include <functional>

#include "server/lab/scenario/scenario_block.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/simulation.h"

namespace trocar::contact::testing {

// A block of neo-Hookean tets, lowest layer fixed; size in nodes, spacing in m. Its top is at
// (ny - 1) / 2 spacings.
inline organ::Organ block(int nx, int ny, int nz, double spacing_m,
                          const std::function<void(organ::Organ&)>& change = {}) {
  auto organ = scenario::make_block({.nx = nx, .ny = ny, .nz = nz, .spacing_m = spacing_m});
  TROCAR_ASSERT(organ.ok());
  organ->material.elastic_law = material::ElasticLaw::NeoHookean;
  organ->material.poisson_ratio = 0.3;
  if (change) change(*organ);
  organ->node_masses_kg = organ::lumped_masses(*organ);
  return *organ;
}

inline float top_of(const organ::Organ& organ) {
  double top = -1;
  for (const auto& p : organ.mesh.rest_positions) top = std::max(top, p.y);
  return static_cast<float>(top);
}

// The shaft points up, and the tip is at the lowest point.
inline Pose upright(const Vec3f& tip) {
  return {tip, rotation_from_z({0, 1, 0})};
}

inline constexpr std::array<std::uint8_t, 2> kHands{0, 1};

class HandScene {
 public:
  explicit HandScene(organ::Organ organ) : simulation(std::move(organ)) {}

  void join(std::uint8_t hand, const tool::ToolShape& shape) {
    hands::HandJoin join{.slot = {hand}};
    join.shapes[0] = shape;
    inputs_.joins.push_back(join);
  }
  void put(std::uint8_t hand, const Pose& pose, tool::Verb verb = tool::Verb::Push) {
    inputs_.samples.push_back({tool_slot({hand}, 0), {pose, verb}});
  }
  void leave(std::uint8_t hand) { inputs_.leaves.push_back({hand}); }
  const step::TickReport& tick() {
    const auto& report = simulation.tick(inputs_, decisions);
    inputs_.clear();
    return report;
  }
  void ticks(int count) {
    for (int i = 0; i < count; ++i) tick();
  }
  // Holds a hand there as long as a script does: a sample every 8 ticks.
  void hold(std::uint8_t hand, const Pose& pose, int count, tool::Verb verb = tool::Verb::Push) {
    for (int i = 0; i < count; ++i) {
      if (i % 8 == 0) put(hand, pose, verb);
      tick();
    }
  }

  Reaction reaction(std::uint8_t hand) const {
    const auto& contacts = simulation.context().contact.found;
    for (const auto& tool : contacts.tools)
      if (tool.tool == tool_slot({hand}, 0))
        return reaction_on(contacts, tool, simulation.state().world);
    return {};
  }
  const Proxy& proxy(std::uint8_t hand) const {
    return simulation.state().proxies[tool_slot({hand}, 0)];
  }
  const world::World& world() const { return simulation.state().world; }

  step::Simulation simulation;
  step::TickDecisions decisions;

 private:
  hands::TickInputs inputs_;
};

}  // namespace trocar::contact::testing
