// A hand that pulls too hard: the tissue tears, not the server.

#include <gtest/gtest.h>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/tissue/cutting/tearing.h"
#include "server/tissue/cutting/validate.h"
#include "server/tissue/step/simulation.h"
#include "tests/support/shared.h"

namespace trocar::step {
namespace {

organ::Organ liver(material::ElasticLaw law, double tear_stretch) {
  auto organ = *catalogue::make_liver(4000);
  organ.material.elastic_law = law;
  organ.material.tear_stretch = tear_stretch;
  return organ;
}

// Takes hold of the end of the left lobe and draws it away, 10 cm/s, until then.
TickReport pull(Simulation& simulation, float until_s = 10) {
  const Tick tick = simulation.current_tick() + 1;
  Vec3f end{-1, 0, 0};
  for (const auto& p : simulation.organ().mesh.rest_positions)
    if (static_cast<float>(p.x) > end.x) end = to_float(p);
  hands::TickInputs inputs;
  if (tick == 1) {
    hands::HandJoin join{.slot = {0}};
    join.shapes[0] = {.radius_m = 0.002f, .length_m = 0.3f, .reach_m = 0.02f};
    inputs.joins.push_back(join);
  }
  if (tick % 4 == 1) {
    const float t = std::min(until_s, static_cast<float>(tick) * 1e-3f);
    const Vec3f drawn{0.1f * std::max(0.0f, t - 0.2f), 0, 0};
    inputs.samples.push_back(
        {tool_slot({0}, 0), {{end + drawn, rotation_from_z({1, 0, 0})}, tool::Verb::Grasp}});
  }
  return simulation.tick(inputs, {});
}

TEST(Tears, AFlapPulledFarEnoughTearsOff) {
  using enum material::ElasticLaw;
  for (const auto law : {Springs, TensorMass, NeoHookean}) {
    Simulation simulation(liver(law, 1.4));
    double torn = 0;
    for (int i = 0; i < 1500; ++i) {
      const auto report = pull(simulation);
      ASSERT_EQ(report.solve.nodes_rejected, 0u) << "tick " << report.tick;
      torn += report.cut.torn_area_m2;
    }
    const auto& state = simulation.state();
    const auto valid = cutting::validate(state.cuts.topology());
    EXPECT_TRUE(valid.ok()) << valid.error().message;
    EXPECT_GT(torn, 1e-5) << static_cast<int>(law);
    EXPECT_GT(cutting::find_pieces(state.cuts.topology()).count, 1u) << static_cast<int>(law);
    EXPECT_FALSE(state.grasps[tool_slot({0}, 0)].nodes.empty()) << "the hand still holds its part";
  }
}

// A thin wall whose strain is averaged, drawn at 0.2 m/s until it tears, held for a second and let
// go.
TEST(Tears, AWallComesToRestWhileItIsHeldAndIsWholeWhenItIsLetGo) {
  TROCAR_SKIP_WITHOUT_SHARED("cases/tissue/wall.organ");
  constexpr float kSpeed_m_s = 0.2f;
  Simulation simulation(*catalogue::load_organ(
      (trocar::testing::shared_folder() / "cases/tissue/wall.organ").string()));
  Vec3f top{0, 0, -1};
  for (const auto& p : simulation.organ().mesh.rest_positions)
    if (static_cast<float>(p.z) > top.z) top = to_float(p);
  double torn = 0;
  for (Tick tick = 1; tick <= 2600; ++tick) {
    hands::TickInputs inputs;
    if (tick == 1) {
      hands::HandJoin join{.slot = {0}};
      join.shapes[0] = {.radius_m = 0.005f, .length_m = 0.3f, .reach_m = 0.012f, .grip_n = 8};
      inputs.joins.push_back(join);
    }
    const float t = std::clamp(static_cast<float>(tick) * 1e-3f - 0.22f, 0.0f, 0.5f);
    if (tick % 4 == 1)
      inputs.samples.push_back({tool_slot({0}, 0),
                                {{top + Vec3f{0, 0, kSpeed_m_s * t}, rotation_from_z({0, 0, 1})},
                                 tick < 1720 ? tool::Verb::Grasp : tool::Verb::None}});
    torn += simulation.tick(inputs, {}).cut.torn_area_m2;
    float fastest = 0;
    for (const auto& v : simulation.state().world.velocities)
      fastest = std::max(fastest, length(v));
    EXPECT_TRUE(tick != 1700 || fastest < 0.01f) << "held: " << fastest;
  }
  EXPECT_GT(torn, 0);
  for (const auto& u : simulation.state().world.displacements)
    ASSERT_LT(length(u), 0.2f) << "it flew away";
  const auto& state = simulation.state();
  const auto& topology = state.cuts.topology();
  const auto place = [&](NodeIndex n) {
    return topology.rest()[n.value] + to_double(state.world.displacements[n.value]);
  };
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t) {
    if (!topology.has_tet(TetIndex{t})) continue;
    const auto& [a, b, c, d] = topology.tet(TetIndex{t});
    const Vec3d origin = place(a);
    ASSERT_GT(dot(cross(place(b) - origin, place(c) - origin), place(d) - origin), 0) << t;
  }
}

// Tissue that tears does not crumble: no piece is of fewer tets than Tearing says. Nothing tears
// half a second after the hand has stopped, although what it holds swings.
TEST(Tears, LeaveNoDebrisAndEndWithTheHand) {
  for (const double tear_stretch : {1.2, 1.4}) {
    Simulation simulation(liver(material::ElasticLaw::NeoHookean, tear_stretch));
    double torn = 0, torn_after = 0;
    for (int i = 0; i < 3000; ++i) {
      const auto report = pull(simulation, 1.2f);
      torn += report.cut.torn_area_m2;
      if (i > 1700) torn_after += report.cut.torn_area_m2;
    }
    EXPECT_GT(torn, 1e-3);
    EXPECT_EQ(torn_after, 0);
    const auto pieces = cutting::find_pieces(simulation.state().cuts.topology());
    EXPECT_GT(pieces.count, 1u);
    EXPECT_GE(*std::ranges::min_element(pieces.tets), cutting::kLeastTorn) << tear_stretch;
  }
}

TEST(Tears, NothingTearsThatIsNotSaidTo) {
  Simulation simulation(liver(material::ElasticLaw::Springs, 0));
  for (int i = 0; i < 600; ++i) ASSERT_EQ(pull(simulation).cut.torn_area_m2, 0);
}

TEST(Tears, ARestoredStateTearsOnBitForBit) {
  Simulation a(liver(material::ElasticLaw::NeoHookean, 1.3)),
      b(liver(material::ElasticLaw::NeoHookean, 1.3));
  double torn = 0;
  for (int i = 0; i < 2000 && torn == 0; ++i) torn += pull(a).cut.torn_area_m2;
  ASSERT_GT(torn, 0);
  Bytes snapshot;
  a.write_snapshot(snapshot);
  ASSERT_TRUE(b.restore_snapshot(snapshot).ok());
  for (int i = 0; i < 150; ++i) ASSERT_EQ(pull(a).state_hash, pull(b).state_hash) << "tick " << i;
}

}  // namespace
}  // namespace trocar::step
