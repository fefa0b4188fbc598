// Wounds in tissue whose fibres are under tension.

#include <gtest/gtest.h>

#include "server/tissue/step/simulation.h"
#include "tests/cutting/cut_organ.h"

namespace trocar::step {
namespace {

// 14 x 2 x 14 cm, held at its rim; fibres along x, or around the middle.
organ::Organ plate(material::ElasticLaw law, bool is_round) {
  auto organ = cutting::testing::box_organ(14, 2, 14, 0.01, 0);
  organ.material.elastic_law = law;
  organ.material.fibre_tension = 0.2;
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n) {
    const auto& p = organ.mesh.rest_positions[n];
    if (std::max(std::abs(p.x), std::abs(p.z)) > 0.069) organ.fixed_nodes.emplace_back(n);
    organ.fibre_directions.push_back(is_round ? normalized(Vec3d{p.z, 0, -p.x}, {})
                                              : Vec3d{1, 0, 0});
  }
  return organ;
}

// How far apart the lips are where they are farthest, after a cut through the plate, m.
double gape_of(const organ::Organ& organ, const Vec3f& from, const Vec3f& to) {
  Simulation simulation(organ);
  hands::TickInputs inputs;
  hands::HandJoin join{.slot = {0}};
  join.shapes[0] = {.radius_m = 0.001f, .length_m = 0.3f, .edge_m = 0.08f};
  inputs.joins.push_back(join);
  for (int tick = 1; tick <= 1100; ++tick) {
    const float share = std::clamp(static_cast<float>(tick - 50) / 400.0f, 0.0f, 1.0f);
    inputs.samples.push_back({tool_slot({0}, 0),
                              {{from + (to - from) * share, rotation_from_z({0, 1, 0})},
                               tick < 460 ? tool::Verb::Cut : tool::Verb::None}});
    EXPECT_EQ(simulation.tick(inputs, {}).solve.nodes_rejected, 0u) << "tick " << tick;
    inputs.clear();
  }
  const auto& u = simulation.state().world.displacements;
  float gape = 0;
  for (const auto& events : simulation.state().cuts.history())
    for (const auto& event : events.events)
      if (const auto* copy = std::get_if<cutting::Duplicate>(&event))
        gape = std::max(gape, length(u[copy->copy.value] - u[copy->node.value]));
  return static_cast<double>(gape);
}

TEST(FibreWounds, GapeWiderAcrossTheFibres) {
  for (const auto law : {material::ElasticLaw::Springs, material::ElasticLaw::NeoHookean}) {
    const auto organ = plate(law, false);
    const double along = gape_of(organ, {-0.03f, -0.04f, 0.003f}, {0.03f, -0.04f, 0.003f});
    const double across = gape_of(organ, {0.003f, -0.04f, -0.03f}, {0.003f, -0.04f, 0.03f});
    EXPECT_GT(across, 0.004) << static_cast<int>(law);
    EXPECT_GT(across, 1.7 * along) << static_cast<int>(law);
  }
}

// The same cut in the same material; what differs is where its fibres run.
TEST(FibreWounds, FollowDirectionsThatTurn) {
  for (const auto law : {material::ElasticLaw::Springs, material::ElasticLaw::NeoHookean}) {
    const Vec3f from{0.015f, -0.04f, 0.003f}, to{0.055f, -0.04f, 0.003f};
    const double around = gape_of(plate(law, true), from, to);
    const double along = gape_of(plate(law, false), from, to);
    EXPECT_GT(around, 0.0025) << static_cast<int>(law);
    EXPECT_GT(around, 1.7 * along) << static_cast<int>(law);
  }
}

}  // namespace
}  // namespace trocar::step
