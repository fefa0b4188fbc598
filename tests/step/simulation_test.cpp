// The tick as a pure function: same inputs, same hash; snapshots continue bit for bit; what comes
// from outside cannot break it.

#include "server/tissue/step/simulation.h"

#include <gtest/gtest.h>

#include <random>

#include "server/tissue/contact/proxies.h"
#include "tests/step/hands.h"

namespace trocar::step {
namespace {

using testing::add_two_hands;
using testing::place_on;

class TwoHands : public ::testing::Test {
 protected:
  static constexpr TickDecisions kFrozen{.depth_limit = kFrozenDepthLimit,
                                         .boundary = world::Boundary::Frozen};
  static TickReport run_tick(Simulation& simulation, const TickDecisions& decisions = {}) {
    hands::TickInputs inputs;
    add_two_hands(simulation.current_tick() + 1, place_on(simulation.organ()), inputs);
    return simulation.tick(inputs, decisions);
  }
};

TEST_F(TwoHands, SameInputsGiveSameHashes) {
  Simulation a(catalogue::make_lattice()), b(catalogue::make_lattice());
  for (int i = 0; i < 600; ++i) ASSERT_EQ(run_tick(a).state_hash, run_tick(b).state_hash);
}

TEST_F(TwoHands, FramesSayHowMuchOfTheStressHasRelaxed) {
  Simulation elastic(*catalogue::make_liver(2000)), measured(*catalogue::make_measured_liver(2000));
  std::shared_ptr<PublishedFrame> frame;
  for (int i = 0; i < 320; ++i) {
    run_tick(elastic), run_tick(measured);
    if (auto next = elastic.pop_frame()) {
      EXPECT_FALSE(next->figures.relaxation);
    }
    if (auto next = measured.pop_frame()) frame = next;
  }
  ASSERT_TRUE(frame && frame->figures.relaxation);
  EXPECT_GT(frame->figures.relaxation->energy_j, 1e-6);
  EXPECT_LT(std::abs(frame->figures.relaxation->volume_change), 0.01);
  EXPECT_GT(frame->figures.relaxation->relaxed_share, 0.01);
  EXPECT_LT(frame->figures.relaxation->relaxed_share, 0.66) << "all that the series takes";
}

TEST_F(TwoHands, AnyInputChangesTheHash) {
  Simulation a(catalogue::make_lattice()), b(catalogue::make_lattice());
  for (int i = 0; i < 50; ++i) run_tick(a), run_tick(b);
  hands::TickInputs inputs;
  add_two_hands(57, place_on(a.organ()), inputs);
  a.tick(inputs, {});
  inputs.samples[0].sample.world_from_tool.position.x += 1e-6f;
  b.tick(inputs, {});
  EXPECT_NE(a.state_hash(), b.state_hash());
}

TEST_F(TwoHands, ASnapshotIsWhatTheHashCoversAndContinuesBitForBit) {
  Simulation a(catalogue::make_lattice());
  for (const int stop : {0, 15, 300}) {
    while (a.current_tick() < static_cast<Tick>(stop)) run_tick(a);
    Bytes snapshot;
    a.write_snapshot(snapshot);
    Simulation b(catalogue::make_lattice());
    const auto restored = b.restore_snapshot(snapshot);
    ASSERT_TRUE(restored.ok()) << restored.error().message;
    EXPECT_EQ(b.state_hash(), a.state_hash());
    Simulation c(catalogue::make_lattice());
    ASSERT_TRUE(c.restore_snapshot(snapshot).ok());
    for (int i = 0; i < 100; ++i) ASSERT_EQ(run_tick(b).state_hash, run_tick(c).state_hash);
    EXPECT_EQ(b.current_tick(), static_cast<Tick>(stop) + 100);
    // And equal to the run that never stopped.
    Simulation d(catalogue::make_lattice());
    while (d.current_tick() < b.current_tick()) run_tick(d);
    EXPECT_EQ(d.state_hash(), b.state_hash());
  }
}

TEST_F(TwoHands, TheHashReportedByATickIsTheHashOfItsSnapshotBetweenPublications) {
  Simulation a(catalogue::make_lattice());
  while (a.current_tick() < 15) run_tick(a);
  const auto reported = a.context().report.state_hash;
  Bytes snapshot;
  a.write_snapshot(snapshot);
  EXPECT_EQ(a.state_hash(), reported);
  Simulation b(catalogue::make_lattice());
  ASSERT_TRUE(b.restore_snapshot(snapshot).ok());
  EXPECT_EQ(b.state_hash(), reported);
}

TEST_F(TwoHands, ATornOrWrongSnapshotIsRefusedAndChangesNothing) {
  Simulation a(catalogue::make_lattice());
  for (int i = 0; i < 100; ++i) run_tick(a);
  Bytes snapshot;
  a.write_snapshot(snapshot);
  Simulation b(catalogue::make_lattice());
  const auto hash = b.state_hash();
  for (std::size_t size = 0; size < snapshot.size(); size += 9973)
    EXPECT_FALSE(b.restore_snapshot(BytesView(snapshot).first(size)).ok());
  auto longer = snapshot;
  longer.push_back(0);
  EXPECT_FALSE(b.restore_snapshot(longer).ok());
  EXPECT_EQ(b.state_hash(), hash);
}

TEST_F(TwoHands, RegionsMergeAndTissueComesToRestAgain) {
  Simulation simulation(catalogue::make_lattice());
  bool was_apart = false, was_merged = false;
  for (int i = 0; i < 1500; ++i) {
    const auto report = run_tick(simulation, kFrozen);
    was_apart |= report.near.region_count == 2;
    was_merged |= report.near.region_count == 1 && report.contact.nodes > 6;
  }
  EXPECT_TRUE(was_apart);
  EXPECT_TRUE(was_merged);
  hands::TickInputs leave;
  leave.leaves = {{0}, {1}};
  simulation.tick(leave, kFrozen);
  int ticks = 0;
  while (simulation.context().report.near.active_nodes > 0 && ticks < 20'000) {
    simulation.tick({}, kFrozen);
    ++ticks;
  }
  EXPECT_LT(ticks, 20'000) << "nothing stays active for ever";
  for (const auto& u : simulation.state().world.displacements)
    EXPECT_EQ(u, Vec3f{}) << "nothing freezes with a dent";
}

TEST_F(TwoHands, FramesCarryTheQuantisedSurfaceAndItsCrc) {
  Simulation simulation(catalogue::make_lattice());
  for (int i = 1; i <= 320; ++i) {
    run_tick(simulation);
    const auto frame = simulation.pop_frame();
    ASSERT_EQ(frame != nullptr, i % 16 == 0);
    if (!frame) continue;
    EXPECT_EQ(frame->frame, static_cast<Frame>(i / 16));
    EXPECT_EQ(frame->surface_crc, wire::surface_crc(frame->surface));
    const auto& layout = simulation.layout();
    for (std::size_t v = 0; v < layout.vertex_count(); ++v) {
      const auto u = simulation.state().world.displacements[layout.node_of_vertex[v].value];
      EXPECT_LE(length(wire::to_metres(frame->surface[v]) - u), 1.3f * wire::kQuantumMetres);
    }
  }
}

TEST(Simulation, APushOnAHeldNodeIsFeltButDoesNotMoveIt) {
  Simulation simulation(catalogue::make_lattice());
  const float top = testing::place_on(simulation.organ()).y;
  hands::TickInputs inputs;
  for (std::uint8_t hand = 0; hand < 2; ++hand) {
    hands::HandJoin join{.slot = {hand}};
    join.shapes[0] = {.radius_m = 0.02f, .length_m = 0.3f, .reach_m = 0.008f};
    inputs.joins.push_back(join);
  }
  float pushed_force = 0;
  Vec3f held_at{};  // once the jaws are closed, before the push
  for (int tick = 1; tick <= 700; ++tick) {
    const auto add = [&](std::uint8_t hand, float height, tool::Verb verb) {
      inputs.samples.push_back(
          {tool_slot({hand}, 0), {{{0, top + height, 0}, rotation_from_z({0, 1, 0})}, verb}});
    };
    add(0, 0, tool::Verb::Grasp);
    add(1, tick < 200 ? 0.02f : -0.003f, tool::Verb::Push);
    simulation.tick(inputs, {});
    inputs.clear();
    const auto frame = simulation.pop_frame();
    if (tick == 190) {
      const auto node = simulation.state().grasps[ToolSlot{0}].nodes.at(0);
      held_at = simulation.state().world.displacements[node.value];
    }
    if (!frame || tick < 600) continue;
    for (const auto& tool : frame->tools)
      if (tool.tool == ToolSlot{2}) pushed_force = tool.force_n.y;
  }
  const auto& grasp = simulation.state().grasps[ToolSlot{0}];
  ASSERT_EQ(grasp.nodes.size(), 4u);
  const Vec3f at_end = simulation.state().world.displacements[grasp.nodes[0].value];
  EXPECT_LT(length(at_end - held_at), 5e-5f) << "the grasp holds its nodes where they are";
  EXPECT_GT(pushed_force, 0.5f) << "the pusher feels them";
}

TEST(Simulation, RandomInputsNeverBreakIt) {
  auto organ = catalogue::make_lattice({.nx = 8, .ny = 6, .nz = 8});
  ASSERT_TRUE(organ.ok());
  Simulation simulation(*organ);
  std::mt19937 random(7);
  const auto pick = [&](std::uint32_t n) { return static_cast<std::uint32_t>(random() % n); };
  std::uniform_real_distribution<float> place(-0.06f, 0.06f);
  for (int tick = 0; tick < 4000; ++tick) {
    hands::TickInputs inputs;
    if (pick(40) == 0) inputs.leaves.push_back({static_cast<std::uint8_t>(pick(20))});
    if (pick(20) == 0) {
      hands::HandJoin join{.slot = {static_cast<std::uint8_t>(pick(20))},
                           .tool_count = static_cast<int>(pick(4))};
      join.shapes[0].radius_m = pick(10) == 0 ? -1.0f : 0.01f;
      inputs.joins.push_back(join);
    }
    for (std::uint32_t i = pick(6); i > 0; --i)
      inputs.samples.push_back(
          {ToolSlot{static_cast<std::uint8_t>(pick(40))},
           {{{place(random), place(random), place(random)}, rotation_from_z({0, 1, 0})},
            static_cast<tool::Verb>(pick(3))}});
    TickDecisions decisions{
        .depth_limit = pick(8), .node_limit = 1 + pick(400), .sweeps = 1 + pick(6)};
    decisions.boundary = pick(100) < 50 ? world::Boundary::Frozen : world::Boundary::Graded;
    const auto report = simulation.tick(inputs, decisions);
    ASSERT_EQ(report.solve.nodes_rejected, 0u);
  }
  for (const auto& u : simulation.state().world.displacements) ASSERT_TRUE(is_finite(u));
  for (std::size_t i = 0; i < simulation.state().world.node_count(); ++i)
    if (simulation.state().world.node_classes[i] == world::NodeClass::Fixed) {
      EXPECT_EQ(simulation.state().world.displacements[i], Vec3f{});
    }
}

TEST(Decisions, OutOfRangeIsRefusedByName) {
  EXPECT_TRUE(validate(TickDecisions{}).ok());
  EXPECT_NE(validate({.sweeps = 0}).error().message.find("sweeps"), std::string::npos);
  EXPECT_NE(validate({.node_limit = 0}).error().message.find("node_limit"), std::string::npos);
  EXPECT_FALSE(validate({.over_relaxation = NAN}).ok());
  EXPECT_FALSE(validate({.depth_limit = 5000}).ok());
}

// Presses a capsule into the liver from `out` at 60 mm/s, and holds it still.
class PressedTip {
 public:
  PressedTip(const organ::Organ& organ, const Vec3f& out, float radius_m)
      : simulation_(organ), out_(out), radius_m_(radius_m) {
    for (const auto& p : organ.mesh.rest_positions)
      if (dot(to_float(p), out) > dot(place_, out)) place_ = to_float(p);
  }

  // The force on it, N; it is `aside_m` from where it was pressed.
  Vec3f tick(float aside_m) {
    hands::TickInputs inputs;
    if (simulation_.current_tick() == 0) {
      hands::HandJoin join{.slot = {0}};
      join.shapes[0] = {.radius_m = radius_m_, .length_m = 0.3f};
      inputs.joins.push_back(join);
    }
    depth_m_ = std::min(0.005f, depth_m_ + 0.06e-3f);
    const Vec3f aside = normalized(cross(out_, Vec3f{0, 1, 0}), {}) * aside_m;
    hand_ = place_ - out_ * depth_m_ + aside;
    inputs.samples.push_back({kTool, {{hand_, rotation_from_z(out_)}, tool::Verb::Push}});
    simulation_.tick(inputs, {});
    const auto& found = simulation_.context().contact.found;
    Vec3f force;
    for (const auto& contact : found.tools)
      force += contact::reaction_on(found, contact, simulation_.state().world).force_n;
    return force;
  }
  // How far it is from the hand across its way, m.
  float across_m() const {
    const Vec3f d = simulation_.state().proxies[kTool].pose.position - hand_;
    return length(d - out_ * dot(d, out_));
  }

 private:
  static constexpr ToolSlot kTool{0};
  Simulation simulation_;
  const Vec3f out_;
  const float radius_m_;
  Vec3f place_, hand_;
  float depth_m_ = -0.001f;
};

// The force on a tip that is held still: its mean, N, and by what part of it it changes in a tick.
struct HeldForce {
  float mean_n = 0, median_change = 0, largest_change = 0;
};
HeldForce force_held(PressedTip& tip, float aside_m) {
  constexpr int kTicks = 200;
  std::vector<float> changes;
  HeldForce held;
  Vec3f last = tip.tick(aside_m);
  for (int i = 0; i < kTicks; ++i) {
    const Vec3f now = tip.tick(aside_m);
    changes.push_back(length(now - last) / length(now));
    held.mean_n += length(now) / kTicks;
    last = now;
  }
  std::ranges::sort(changes);
  held.median_change = changes[kTicks / 2];
  held.largest_change = changes.back();
  return held;
}

// A thin tip stops at the greatest pressure before it is where the hand is. Held still there, the
// force on it is as steady as that of a thicker one, and so it is where it was dragged to.
TEST(Simulation, AThinTipThatIsHeldStillDoesNotBuzz) {
  const auto organ = *catalogue::make_liver();
  for (const Vec3f& from : {Vec3f{-1, 0.15f, 0.7f}, {0.1f, 0.9f, 0.4f}, {0.02f, 0.1f, 1}})
    for (const float radius_m : {0.002f, 0.003f, 0.005f}) {
      PressedTip tip(organ, normalized(from, {}), radius_m);
      for (int i = 0; i < 140; ++i) tip.tick(0);
      const auto pressed = force_held(tip, 0);
      const float across_m = tip.across_m();
      EXPECT_LT(pressed.largest_change, 0.005f);
      constexpr float kDrag_m = 0.03e-3f;
      for (int i = 1; i <= 100; ++i) tip.tick(kDrag_m * static_cast<float>(i));
      for (int i = 0; i < 160; ++i) tip.tick(100 * kDrag_m);
      const auto dragged = force_held(tip, 100 * kDrag_m);
      for (const auto& [held, across] : {std::pair{pressed, across_m}, {dragged, tip.across_m()}}) {
        std::printf(
            "radius %.0f mm: %.4f N, changes by %.2f %% in a tick, %.2f %% at most; "
            "%.2f mm across\n",
            radius_m * 1e3f, held.mean_n, 100 * held.median_change, 100 * held.largest_change,
            1e3 * across);
        EXPECT_LT(held.median_change, 0.005f);
        EXPECT_LT(across, 1e-3f);
      }
    }
}

}  // namespace
}  // namespace trocar::step
