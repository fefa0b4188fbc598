// An instructor's mark: the organ returns to it, cuts and all, and everything goes on from there.

#include <gtest/gtest.h>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/cutting/validate.h"
#include "server/tissue/step/simulation.h"

namespace trocar::step {
namespace {

organ::Organ liver() {
  auto organ = *catalogue::make_liver(4000);
  organ.material.elastic_law = material::ElasticLaw::NeoHookean;
  return organ;
}

// A blade along the top, 10 cm/s; and a hand that holds and lifts the end of a lobe.
TickReport run_tick(Simulation& simulation, hands::MarkAction mark = hands::MarkAction::None,
                    std::uint8_t number = 0) {
  const Tick tick = simulation.current_tick() + 1;
  Vec3f top{0, -1, 0}, end{-1, 0, 0};
  for (const auto& p : simulation.organ().mesh.rest_positions) {
    if (static_cast<float>(p.y) > top.y) top = to_float(p);
    if (static_cast<float>(p.x) > end.x) end = to_float(p);
  }
  hands::TickInputs inputs;
  inputs.mark = mark;
  inputs.mark_number = number;
  if (tick == 1)
    for (std::uint8_t hand = 0; hand < 2; ++hand) {
      hands::HandJoin join{.slot = {hand}};
      join.shapes[0] = {.radius_m = 0.002f, .length_m = 0.3f, .reach_m = 0.012f, .edge_m = 0.06f};
      inputs.joins.push_back(join);
    }
  if (tick % 4 == 1) {
    const float t = static_cast<float>(tick % 1000) * 1e-3f;
    const float depth = std::min(0.02f, 0.1f * t - 0.005f);
    const float along = 0.1f * std::max(0.0f, t - 0.25f);
    inputs.samples.push_back(
        {tool_slot({0}, 0),
         {{top + Vec3f{-0.03f + along, -depth, 0}, rotation_from_z({0, 1, 0})}, tool::Verb::Cut}});
    inputs.samples.push_back(
        {tool_slot({1}, 0),
         {{end + Vec3f{0, 0.02f * t, 0}, rotation_from_z({1, 0, 0})}, tool::Verb::Grasp}});
  }
  return simulation.tick(inputs, {});
}

void run(Simulation& simulation, int ticks) {
  for (int i = 0; i < ticks; ++i) run_tick(simulation);
}

TEST(Marks, BringBackShapeAndTopology) {
  Simulation simulation(liver());
  run(simulation, 463);
  const auto before = simulation.layout();
  const auto displacements = simulation.state().world.displacements;
  ASSERT_GT(simulation.state().cuts.history().size(), 1u) << "the mark is in the middle of a cut";
  run_tick(simulation, hands::MarkAction::Set);
  run(simulation, 300);
  ASSERT_GT(simulation.layout().triangles.size(), before.triangles.size());
  const auto epoch = simulation.layout().epoch;

  const auto report = run_tick(simulation, hands::MarkAction::Return);
  EXPECT_EQ(report.solve.nodes_rejected, 0u);
  EXPECT_EQ(simulation.current_tick(), 765u) << "time goes on";
  EXPECT_EQ(simulation.layout().triangles, before.triangles);
  EXPECT_EQ(simulation.layout().rest_quanta, before.rest_quanta);
  EXPECT_EQ(simulation.layout().epoch, epoch) << "until it is published";
  const auto& now = simulation.state().world.displacements;
  ASSERT_EQ(now.size(), displacements.size());
  for (std::size_t n = 0; n < now.size(); ++n)
    ASSERT_LT(length(now[n] - displacements[n]), 3e-4f) << "two ticks of motion";
  EXPECT_TRUE(simulation.state().grasps[tool_slot({1}, 0)].nodes.empty()) << "jaws open first";
  EXPECT_FALSE(simulation.state().claims.is_in_effect(tool_slot({0}, 0)));
  run(simulation, 200);
  const auto valid = cutting::validate(simulation.state().cuts.topology());
  EXPECT_TRUE(valid.ok()) << valid.error().message;
}

TEST(Marks, StandSideBySideAndAreInSnapshots) {
  Simulation simulation(liver());
  run(simulation, 463);
  const auto first = simulation.layout().triangles;
  run_tick(simulation, hands::MarkAction::Set);
  const auto with_one = simulation.state_hash();
  run(simulation, 300);
  const auto second = simulation.layout().triangles;
  ASSERT_LT(first.size(), second.size());
  run_tick(simulation, hands::MarkAction::Set, 2);
  EXPECT_NE(simulation.state_hash(), with_one);
  Bytes snapshot;
  simulation.write_snapshot(snapshot);
  run(simulation, 100);
  run_tick(simulation, hands::MarkAction::Return);
  EXPECT_EQ(simulation.layout().triangles, first);
  run_tick(simulation, hands::MarkAction::Return, 2);
  EXPECT_EQ(simulation.layout().triangles, second);
  run_tick(simulation, hands::MarkAction::Return, 1);
  EXPECT_FALSE(simulation.state().marks.is_set(1)) << "there is no such mark";

  Simulation other(liver());
  ASSERT_TRUE(other.restore_snapshot(snapshot).ok());
  EXPECT_TRUE(other.state().marks.is_set(0) && other.state().marks.is_set(2));
  run_tick(other, hands::MarkAction::Return);
  EXPECT_EQ(other.layout().triangles, first);
  run_tick(other, hands::MarkAction::Return, 2);
  EXPECT_EQ(other.layout().triangles, second);
  // Bytes that are cut short or wrong are no snapshot.
  auto wrong = snapshot;
  wrong[100] ^= 1;
  EXPECT_FALSE(other.restore_snapshot(wrong).ok());
  EXPECT_FALSE(other.restore_snapshot(BytesView(snapshot).first(snapshot.size() / 2)).ok());
}

// Clients follow a session with marks by what they are told: changes, and at a return the whole
// surface.
TEST(Marks, AreFollowedFrameByFrame) {
  Simulation simulation(liver());
  auto followed = simulation.layout();
  int new_layouts = 0, marks = 0;
  for (int i = 1; i <= 1600; ++i) {
    run_tick(simulation, i == 300                ? hands::MarkAction::Set
                         : i == 700 || i == 1301 ? hands::MarkAction::Return
                                                 : hands::MarkAction::None);
    const auto frame = simulation.pop_frame();
    if (!frame) continue;
    if (frame->new_layout) {
      EXPECT_GT(frame->new_layout->epoch, followed.epoch);
      followed = *frame->new_layout;
      ++new_layouts;
    }
    if (frame->change) {
      ASSERT_TRUE(wire::apply(*frame->change, followed).ok()) << "tick " << i;
    }
    for (const auto& event : frame->mark_events) marks += event.is_done;
    ASSERT_EQ(followed.triangles, simulation.layout().triangles) << "tick " << i;
    ASSERT_EQ(followed.rest_quanta, simulation.layout().rest_quanta) << "tick " << i;
    ASSERT_EQ(followed.epoch, simulation.layout().epoch) << "tick " << i;
    ASSERT_EQ(followed.triangle_sum, simulation.layout().triangle_sum) << "tick " << i;
    ASSERT_EQ(frame->surface.size(), followed.vertex_count());
  }
  EXPECT_EQ(new_layouts, 2);
  EXPECT_EQ(marks, 3);
}

TEST(Marks, AreInSnapshotsAndInTheHash) {
  Simulation a(liver()), b(liver());
  run(a, 330);
  const auto hash = a.state_hash();
  run_tick(a, hands::MarkAction::Set);
  EXPECT_NE(a.state_hash(), hash);
  run(a, 299);
  const auto follow = [&](int ticks, Tick return_at) {
    Bytes snapshot;
    a.write_snapshot(snapshot);
    const auto restored = b.restore_snapshot(snapshot);
    ASSERT_TRUE(restored.ok()) << restored.error().message;
    for (int i = 0; i < ticks; ++i) {
      const auto mark =
          a.current_tick() + 1 == return_at ? hands::MarkAction::Return : hands::MarkAction::None;
      ASSERT_EQ(run_tick(a, mark).state_hash, run_tick(b, mark).state_hash) << "tick " << i;
      const auto frame_a = a.pop_frame(), frame_b = b.pop_frame();
      ASSERT_EQ(frame_a == nullptr, frame_b == nullptr);
      if (!frame_a) continue;
      ASSERT_EQ(frame_a->new_layout == nullptr, frame_b->new_layout == nullptr);
      ASSERT_EQ(frame_a->surface_crc, frame_b->surface_crc);
    }
  };
  follow(20, 640);
  run(a, 3);
  run_tick(a, hands::MarkAction::Return);
  follow(60, 0);  // between the return and the frame that tells of it
}

TEST(Marks, WithoutOneNothingHappens) {
  Simulation a(liver()), b(liver());
  run(a, 20), run(b, 20);
  EXPECT_EQ(run_tick(a, hands::MarkAction::Return).state_hash, run_tick(b).state_hash);
  run(a, 11), run(b, 11);
  const auto frame = a.pop_frame();
  ASSERT_TRUE(frame);
  ASSERT_EQ(frame->mark_events.size(), 1u);
  EXPECT_FALSE(frame->mark_events[0].is_done);
  EXPECT_EQ(frame->mark_events[0].tick, 21u);
}

}  // namespace
}  // namespace trocar::step
