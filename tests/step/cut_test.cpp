// Blades in a session's own tick: what they cut, and that everything else follows.

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "server/tissue/cutting/event_codec.h"
#include "server/tissue/cutting/validate.h"
#include "server/tissue/step/simulation.h"
#include "tests/cutting/cut_organ.h"
#include "tests/step/hands.h"
#include "tests/support/random.h"

namespace trocar::step {
namespace {

// Blades come down into the liver from above and slice along it at 10 cm/s, side by side.
class Blades : public ::testing::Test {
 protected:
  static organ::Organ liver(material::ElasticLaw law, bool has_averaged_strain = false) {
    auto organ = *catalogue::make_liver(6000);
    organ.material.elastic_law = law;
    organ.material.has_averaged_strain = has_averaged_strain;
    if (law != material::ElasticLaw::Measured) return organ;
    material::use_measured(*material::find_measured_material("human_liver_nava2008"),
                           organ.material);
    organ.material.tension = 0.03;  // so that there are stresses to remember
    return organ;
  }
  static void add_blades(const Simulation& simulation, hands::TickInputs& inputs,
                         std::uint8_t count = 1) {
    const Tick tick = simulation.current_tick() + 1;
    Vec3f top{0, -1, 0};
    for (const auto& p : simulation.organ().mesh.rest_positions)
      if (static_cast<float>(p.y) > top.y) top = to_float(p);
    for (std::uint8_t hand = 0; hand < count; ++hand) {
      if (tick == 1) {
        hands::HandJoin join{.slot = {hand}};
        join.shapes[0] = {.radius_m = 0.002f, .length_m = 0.3f, .edge_m = 0.06f};
        inputs.joins.push_back(join);
      }
      if (tick % 4 != 1) continue;
      const float t = static_cast<float>(tick) * 1e-3f;
      const float depth = std::min(0.02f, 0.1f * t - 0.005f);
      const float along = 0.1f * std::max(0.0f, t - 0.25f);
      const Vec3f tip = top + Vec3f{-0.03f + along, -depth, 0.02f * static_cast<float>(hand)};
      inputs.samples.push_back(
          {tool_slot({hand}, 0), {{tip, rotation_from_z({0, 1, 0})}, tool::Verb::Cut}});
    }
  }
  static TickReport run_tick(Simulation& simulation, std::uint8_t count = 1) {
    hands::TickInputs inputs;
    add_blades(simulation, inputs, count);
    return simulation.tick(inputs, {});
  }
};

TEST_F(Blades, OpenAWoundInEveryKindOfTissue) {
  using enum material::ElasticLaw;
  for (const auto& [law, is_averaged] : {std::pair{Springs, false},
                                         {TensorMass, false},
                                         {NeoHookean, false},
                                         {NeoHookean, true},
                                         {Measured, false},
                                         {Measured, true}}) {
    Simulation simulation(liver(law, is_averaged));
    const double mass = [&] {
      double sum = 0;
      for (const double m : simulation.organ().node_masses_kg) sum += m;
      return sum;
    }();
    double opened = 0;
    Vec3f force{};
    for (int i = 0; i < 700; ++i) {
      const auto report = run_tick(simulation);
      ASSERT_EQ(report.solve.nodes_rejected, 0u) << "tick " << i;
      opened += report.cut.opened_area_m2;
      if (i == 500) force = simulation.state().cuts.felt(ToolSlot{0}).force_n;
    }
    const auto& state = simulation.state();
    EXPECT_GT(opened, 3e-4);
    EXPECT_LT(force.x, -0.1f) << "the tissue holds the blade back";
    const auto valid = cutting::validate(state.cuts.topology());
    EXPECT_TRUE(valid.ok()) << valid.error().message;
    double sum = 0;
    float farthest = 0;
    for (std::size_t n = 0; n < state.world.node_count(); ++n) {
      sum += static_cast<double>(state.world.masses[n]);
      farthest = std::max(farthest, length(state.world.displacements[n]));
    }
    EXPECT_NEAR(sum, mass, 1e-5 * mass);
    EXPECT_LT(farthest, 0.02f);
  }
}

TEST_F(Blades, WorkersDoNotChangeTheHash) {
  for (const auto law : {material::ElasticLaw::NeoHookean, material::ElasticLaw::Measured}) {
    Simulation one(liver(law)), two(liver(law), 2);
    for (int i = 0; i < 500; ++i)
      ASSERT_EQ(run_tick(one, 2).state_hash, run_tick(two, 2).state_hash) << "tick " << i;
  }
}

// A blade may cut tissue that sleeps, before any step has been solved since it was read.
TEST_F(Blades, CutTissueThatWasReadAsleep) {
  using enum material::ElasticLaw;
  for (const auto& [law, is_averaged] : {std::pair{Springs, false},
                                         {NeoHookean, false},
                                         {NeoHookean, true},
                                         {Measured, false},
                                         {Measured, true}}) {
    auto organ = liver(law, is_averaged);
    organ.material.tension = 0;
    Simulation a(organ), b(organ);
    std::uint32_t awake = 1;
    for (int i = 0; i < 300; ++i) awake = a.tick({}, {}).near.active_nodes;
    ASSERT_EQ(awake, 0u);
    Bytes snapshot;
    a.write_snapshot(snapshot);
    ASSERT_TRUE(b.restore_snapshot(snapshot).ok());
    double opened = 0;
    for (int i = 0; i < 400; ++i) {
      hands::TickInputs inputs;
      if (i == 0) inputs.joins.push_back({.slot = {0}, .shapes = {{{.radius_m = 0.002f}}}});
      add_blades(a, inputs);
      const auto report = a.tick(inputs, {});
      opened += report.cut.opened_area_m2;
      ASSERT_EQ(b.tick(inputs, {}).state_hash, report.state_hash) << "tick " << i;
    }
    EXPECT_GT(opened, 0);
  }
}

TEST_F(Blades, ARestoredStateGoesOnBitForBit) {
  using enum material::ElasticLaw;
  for (const auto& [law, is_averaged] : {std::pair{Springs, false},
                                         {NeoHookean, false},
                                         {NeoHookean, true},
                                         {Measured, false},
                                         {Measured, true}}) {
    Simulation a(liver(law, is_averaged)), b(liver(law, is_averaged));
    for (int i = 0; i < 421; ++i) run_tick(a, 2);
    Bytes snapshot;
    a.write_snapshot(snapshot);
    const auto restored = b.restore_snapshot(snapshot);
    ASSERT_TRUE(restored.ok()) << restored.error().message;
    EXPECT_EQ(a.state_hash(), b.state_hash());
    EXPECT_EQ(a.layout(), b.layout());
    for (int i = 0; i < 200; ++i) {
      ASSERT_EQ(run_tick(a, 2).state_hash, run_tick(b, 2).state_hash) << "tick " << i;
      const auto frame_a = a.pop_frame(), frame_b = b.pop_frame();
      ASSERT_EQ(frame_a == nullptr, frame_b == nullptr);
      if (!frame_a) continue;
      ASSERT_EQ(frame_a->change == nullptr, frame_b->change == nullptr);
      if (frame_a->change) {
        ASSERT_EQ(*frame_a->change, *frame_b->change);
      }
      ASSERT_EQ(frame_a->surface_crc, frame_b->surface_crc);
    }
  }
}

// Changes that clients are told turn the surface they began with into the current one.
TEST_F(Blades, ChangesLeadFromSurfaceToSurface) {
  Simulation simulation(liver(material::ElasticLaw::Springs));
  auto followed = simulation.layout();
  for (int i = 0; i < 700; ++i) {
    run_tick(simulation, 2);
    const auto frame = simulation.pop_frame();
    if (!frame) continue;
    EXPECT_EQ(frame->surface.size(), simulation.layout().vertex_count());
    if (!frame->change) continue;
    const auto applied = wire::apply(*frame->change, followed);
    ASSERT_TRUE(applied.ok()) << applied.error().message;
    followed.vertex_of_node.resize(simulation.state().world.node_count());
    ASSERT_EQ(followed, simulation.layout());
    ASSERT_EQ(followed.compute_triangle_sum(), followed.triangle_sum);
  }
  EXPECT_GT(followed.epoch, 10u);
}

// Vessels will bleed, some day: who follows a session hears what has been laid open.
TEST_F(Blades, ChangesNameTheRegionsThatAreCut) {
  auto organ = liver(material::ElasticLaw::Springs);
  Vec3f top{0, -1, 0};
  for (const auto& p : organ.mesh.rest_positions)
    if (static_cast<float>(p.y) > top.y) top = to_float(p);
  const auto region = [&](const char* name, auto&& holds) {
    std::vector<NodeIndex> nodes;
    for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
      if (holds(organ.mesh.rest_positions[n])) nodes.emplace_back(n);
    organ.regions.push_back({name, organ.material, nodes});
  };
  region("vessel", [&](const Vec3d& p) { return std::abs(p.x - double(top.x)) < 0.02; });
  region("far away", [&](const Vec3d& p) { return p.x < double(top.x) - 0.06; });
  Simulation simulation(organ);
  std::set<std::string> named;
  for (int i = 0; i < 800; ++i) {
    run_tick(simulation);
    if (const auto frame = simulation.pop_frame(); frame && frame->change)
      named.insert(frame->change->regions.begin(), frame->change->regions.end());
  }
  EXPECT_EQ(named, std::set<std::string>{"vessel"});
}

// A piece that a through cut has separated moves by itself: the free end is drawn away.
TEST_F(Blades, APieceThatIsCutOffCanBeCarriedAway) {
  Simulation simulation(liver(material::ElasticLaw::NeoHookean));
  Vec3f end{-1, 0, 0};
  for (const auto& p : simulation.organ().mesh.rest_positions)
    if (static_cast<float>(p.x) > end.x) end = to_float(p);
  hands::TickInputs inputs;
  for (std::uint8_t hand = 0; hand < 2; ++hand) {
    hands::HandJoin join{.slot = {hand}};
    join.shapes[0] = {.radius_m = 0.002f, .length_m = 0.3f, .reach_m = 0.02f, .edge_m = 0.2f};
    inputs.joins.push_back(join);
  }
  for (int tick = 1; tick <= 1400; ++tick) {
    if (tick % 4 == 1) {
      const float t = static_cast<float>(tick) * 1e-3f;
      const Vec3f tip = end + Vec3f{-0.035f, 0.08f - 0.2f * t, -0.1f};
      inputs.samples.push_back(
          {tool_slot({0}, 0),
           {{tip, rotation_from_z({0, 0, 1})}, t < 0.9f ? tool::Verb::Cut : tool::Verb::None}});
      const Vec3f drawn{0.1f * std::max(0.0f, t - 1), 0, 0};
      inputs.samples.push_back(
          {tool_slot({1}, 0), {{end + drawn, rotation_from_z({1, 0, 0})}, tool::Verb::Grasp}});
    }
    ASSERT_EQ(simulation.tick(inputs, {}).solve.nodes_rejected, 0u) << "tick " << tick;
    inputs.clear();
  }
  const auto& state = simulation.state();
  const auto pieces = cutting::find_pieces(state.cuts.topology());
  ASSERT_EQ(pieces.count, 2u);
  // Each piece moves as one: the smaller one by what the hand has gone, the other hardly.
  double moved[2] = {0, 0};
  int nodes[2] = {0, 0};
  for (std::uint32_t n = 0; n < state.world.node_count(); ++n) {
    const auto tets = state.cuts.topology().tets_of(NodeIndex(n));
    if (tets.empty()) continue;
    const auto piece = pieces.piece_of_tet[tets[0].value];
    moved[piece] += static_cast<double>(state.world.displacements[n].x);
    ++nodes[piece];
  }
  const int small = nodes[0] < nodes[1] ? 0 : 1;
  EXPECT_NEAR(moved[small] / nodes[small], 0.04, 0.012);
  EXPECT_NEAR(moved[1 - small] / nodes[1 - small], 0, 0.002);
}

TEST_F(Blades, StopAtWhatAnotherHolds) {
  Simulation simulation(liver(material::ElasticLaw::Springs));
  hands::TickInputs inputs;
  Vec3f top{0, -1, 0};
  for (const auto& p : simulation.organ().mesh.rest_positions)
    if (static_cast<float>(p.y) > top.y) top = to_float(p);
  hands::HandJoin join{.slot = {1}};
  join.shapes[0] = {.reach_m = 0.012f};
  inputs.joins.push_back(join);
  int refused = 0, granted = 0;
  float stop_n = 0;
  for (int tick = 1; tick <= 700; ++tick) {
    if (tick % 8 == 1)
      inputs.samples.push_back(
          {tool_slot({1}, 0), {{top, rotation_from_z({0, 1, 0})}, tool::Verb::Grasp}});
    add_blades(simulation, inputs);
    simulation.tick(inputs, {});
    inputs.clear();
    if (const auto frame = simulation.pop_frame()) {
      for (const auto& event : frame->claim_events) {
        if (event.verb != tool::Verb::Cut) continue;
        refused += event.outcome == hands::ClaimOutcome::RefusedHeld;
        granted += event.outcome == hands::ClaimOutcome::Granted;
      }
      for (const auto& tool : frame->tools)
        if (refused > 0 && tool.tool == tool_slot({0}, 0))
          stop_n = std::max(stop_n, -tool.force_n.x);
    }
    const auto& state = simulation.state();
    for (const auto node : state.grasps[tool_slot({1}, 0)].nodes)
      ASSERT_NE(state.claims.owner(node), tool_slot({0}, 0));
  }
  EXPECT_GE(granted, 1);
  EXPECT_GE(refused, 1);
  EXPECT_GT(stop_n, 2) << "against the blade, which goes on along x";
  EXPECT_FALSE(simulation.state().grasps[tool_slot({1}, 0)].nodes.empty());
}

// Clients hold rest positions to be constant: a history that moves nodes is no session's.
TEST(Snapshots, ThatMoveNodesAreRefused) {
  const auto organ = cutting::testing::box_organ(3, 3, 3, 0.01, 0);
  const auto read = [&](const cutting::CutEvent& event) {
    const cutting::CutEvents events{{event}, {}};
    Bytes hashed(sizeof(std::uint64_t)), bytes;
    cutting::encode(events, hashed);
    auto writing = world::StateArchive::writing(bytes);
    std::uint64_t hash = xxh3_64(hashed);
    Tick last_work = 0;
    std::uint32_t published = 0, epoch = 0, count = 1;
    bool is_new = false;
    writing.value(hash);
    writing.value(last_work);
    writing.value(published);
    writing.value(epoch);
    writing.flag(is_new);
    writing.value(count);
    auto written = events;
    cutting::visit_state(writing, written);
    Bytes idle;  // an uncut organ's, without its history
    blades::TissueCuts uncut(organ);
    const auto ignore = [](const topology::Edit&) {};
    auto writing_idle = world::StateArchive::writing(idle);
    uncut.visit_state(writing_idle, ignore);
    bytes.insert(bytes.end(), idle.begin() + 29, idle.end());
    blades::TissueCuts cuts(organ);
    auto reading = world::StateArchive::reading(bytes);
    cuts.visit_state(reading, ignore);
    return reading.ok() && reading.at_end();
  };
  const topology::Topology topology(organ);
  const NodeIndex inner(21u), beside(22u);  // (1, 1, 1) and (2, 1, 1)
  ASSERT_TRUE(cutting::can_move(topology, {inner, beside, 6000}));
  EXPECT_FALSE(read(cutting::Move{inner, beside, 6000}));
  EXPECT_TRUE(read(cutting::Split{inner, beside, 32768, NodeIndex(64u)}))
      << "another event in its place is taken";
}

// Eight blades are thrown through the organ and back, 80 mm each frame: faster than any hand. What
// lies between is not cut. The same way at a hand's speed is.
TEST_F(Blades, ThatJumpCutNothingBetween) {
  for (const Tick ticks_of_a_way : {16u, 256u}) {
    Simulation simulation(liver(material::ElasticLaw::Springs));
    hands::TickInputs inputs;
    for (std::uint8_t hand = 0; hand < 8; ++hand) {
      hands::HandJoin join{.slot = {hand}};
      join.shapes[0] = {.radius_m = 0.002f, .length_m = 0.3f, .edge_m = 0.04f};
      inputs.joins.push_back(join);
    }
    double opened_m2 = 0;
    for (Tick tick = 1; tick <= 512; ++tick) {
      const bool is_thrown = ticks_of_a_way == 16;
      for (std::uint8_t hand = 0; hand < 8 && (is_thrown ? tick % 16 : tick % 8) == 1; ++hand) {
        const Tick ways = tick / ticks_of_a_way, gone = tick % ticks_of_a_way;
        const float part =
            is_thrown ? 0 : static_cast<float>(gone) / static_cast<float>(ticks_of_a_way);
        const float along = ways % 2 == 0 ? part : 1 - part;
        const float beside = 0.01f * (static_cast<float>(hand) - 3.5f);
        inputs.samples.push_back(
            {tool_slot({hand}, 0),
             {{{beside, -0.03f, -0.04f + 0.08f * along}, rotation_from_z({0, 1, 0})},
              tool::Verb::Cut}});
      }
      const auto& report = simulation.tick(inputs, {});
      inputs.clear();
      opened_m2 += report.cut.opened_area_m2;
    }
    if (ticks_of_a_way == 16)
      EXPECT_EQ(opened_m2, 0);
    else
      EXPECT_GT(opened_m2, 1e-3);
  }
}

TEST_F(Blades, ThatAreEverywhereAtOnceAreBoundedWork) {
  Simulation simulation(liver(material::ElasticLaw::Springs));
  trocar::testing::Random random(3);
  hands::TickInputs inputs;
  for (std::uint8_t hand = 0; hand < 4; ++hand) {
    hands::HandJoin join{.slot = {hand}};
    join.shapes[0] = {.radius_m = 0.002f, .length_m = 0.3f, .edge_m = 0.05f};
    inputs.joins.push_back(join);
  }
  const auto unit = [&] { return static_cast<float>(random.between(-1, 1)); };
  for (int tick = 1; tick <= 400; ++tick) {
    for (std::uint8_t hand = 0; hand < 4; ++hand) {
      const float far = tick % 7 == 0 ? 1.0f : 0.08f;
      const Vec3f tip{far * unit(), far * unit(), far * unit()};
      const Vec3f shaft = normalized(Vec3f{unit(), unit(), unit()}, {0, 1, 0});
      inputs.samples.push_back({tool_slot({hand}, 0),
                                {{tip, rotation_from_z(shaft)},
                                 random.below(5) == 0 ? tool::Verb::None : tool::Verb::Cut}});
    }
    const auto& report = simulation.tick(inputs, {});
    inputs.clear();
    ASSERT_LE(report.cut.splits, cutting::Settings{}.edits_per_call) << "tick " << tick;
    for (const auto& u : simulation.state().world.displacements) ASSERT_TRUE(is_finite(u));
  }
  const auto valid = cutting::validate(simulation.state().cuts.topology());
  EXPECT_TRUE(valid.ok()) << valid.error().message;
}

}  // namespace
}  // namespace trocar::step
