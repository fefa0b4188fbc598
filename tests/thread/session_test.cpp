// Threads in the tick: state, snapshot, mark, and a hand that holds one.

#include <gtest/gtest.h>

#include <cmath>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/simulation.h"
#include "server/tissue/step/thread_stage.h"
#include "tests/thread/laid_thread.h"

namespace trocar::thread {
namespace {

// A lattice, with a thread on a floor beside it that one hand lifts.
class LiftedThread {
 public:
  LiftedThread() : simulation(catalogue::make_lattice(), 1, {.threads = rules()}) {}

  const step::TickReport& tick(hands::MarkAction mark = hands::MarkAction::None) {
    hands::TickInputs inputs;
    inputs.mark = mark;
    const auto tick = simulation.current_tick() + 1;
    if (tick == 1) inputs.joins.push_back({.slot = {0}, .tool_count = 1, .shapes = {}});
    const float height = tick < 200 ? 0.002f : 0.002f + 1e-4f * static_cast<float>(tick - 200);
    inputs.samples.push_back(
        {ToolSlot{0}, {{{0, height, kZ}, rotation_from_z({0, 1, 0})}, tool::Verb::Grasp}, 0});
    return simulation.tick(inputs, {});
  }
  void run(int ticks) {
    for (int k = 0; k < ticks; ++k) tick();
  }
  const Threads& threads() const { return *simulation.state().threads; }

  step::Simulation simulation;

 private:
  static constexpr float kZ = 0.3f;  // far from the tissue
  static Rules rules() {
    auto rules = rules_of(silk_along({{-0.04, 0, kZ}, {0.04, 0, kZ}}));
    rules.gravity_m_s2 = {0, -9.81, 0};
    rules.floor_y_m = 0;
    return rules;
  }
};

TEST(ThreadInTheTick, AHandLiftsAndFeelsIt) {
  LiftedThread lifted;
  lifted.run(500);
  EXPECT_GT(lifted.threads().places_m[40].y, 0.025);
  EXPECT_FALSE(lifted.threads().holds.nodes.empty());
  auto frame = lifted.simulation.pop_frame();
  while (frame == nullptr) {
    lifted.tick();
    frame = lifted.simulation.pop_frame();
  }
  ASSERT_EQ(frame->tools.size(), 1u);
  EXPECT_LT(frame->tools[0].force_n.y, -1e-5f);
}

TEST(ThreadInTheTick, EqualInputsGiveEqualHashesAlsoFromASnapshot) {
  LiftedThread one, two, three;
  for (int k = 0; k < 250; ++k) ASSERT_EQ(one.tick().state_hash, two.tick().state_hash);
  Bytes bytes;
  one.simulation.write_snapshot(bytes);
  ASSERT_TRUE(three.simulation.restore_snapshot(bytes).ok());
  for (int k = 0; k < 100; ++k) ASSERT_EQ(one.tick().state_hash, three.tick().state_hash) << k;
}

TEST(ThreadInTheTick, ADamagedSnapshotIsRefused) {
  LiftedThread one;
  one.run(50);
  Bytes bytes;
  one.simulation.write_snapshot(bytes);
  for (const std::size_t cut : {1u, 100u, 1000u, 5000u}) {
    const BytesView less(bytes.data(), bytes.size() - cut);
    EXPECT_FALSE(one.simulation.restore_snapshot(less).ok()) << cut;
  }
}

// Whatever of it is no number, or no place on a segment.
TEST(ThreadInTheTick, ASnapshotOfWhatCannotBeIsRefused) {
  const auto is_read = [](auto&& change) {
    LiftedThread lifted;
    lifted.run(250);
    Threads threads = lifted.threads();
    threads.pairs = {{0}, {9}, {0.5}, {0.5}, {1}, {Vec3d{}}};
    change(threads);
    Bytes bytes;
    auto writing = world::StateArchive::writing(bytes);
    threads.visit_state(writing);
    Threads read = lifted.threads();
    auto reading = world::StateArchive::reading(bytes);
    read.visit_state(reading);
    return reading.ok();
  };
  EXPECT_TRUE(is_read([](Threads&) {}));
  EXPECT_FALSE(is_read([](Threads& now) { now.places_m[3].x = NAN; }));
  EXPECT_FALSE(is_read([](Threads& now) { now.creeps_m[3].y = NAN; }));
  EXPECT_FALSE(is_read([](Threads& now) { now.tensions_n[3] = NAN; }));
  EXPECT_FALSE(is_read([](Threads& now) { now.holds.offsets_m[0].z = INFINITY; }));
  EXPECT_FALSE(is_read([](Threads& now) { now.pairs.place_first[0] = 2; }));
  EXPECT_FALSE(is_read([](Threads& now) { now.pairs.press_n[0] = NAN; }));
  EXPECT_FALSE(is_read([](Threads& now) { now.pairs.second[0] = 1'000'000; }));
}

TEST(ThreadInTheTick, AMarkBringsItBackAndNobodyHoldsIt) {
  LiftedThread lifted;
  lifted.run(50);
  lifted.tick(hands::MarkAction::Set);
  lifted.run(400);
  EXPECT_GT(lifted.threads().places_m[40].y, 0.02);
  lifted.tick(hands::MarkAction::Return);
  EXPECT_LT(lifted.threads().places_m[40].y, 0.003);
  lifted.run(20);
  EXPECT_TRUE(lifted.threads().holds.nodes.empty());
}

TEST(ThreadInTheTick, WithoutThreadsTheHashIsAsItWas) {
  step::Simulation plain(catalogue::make_lattice()),
      threaded(catalogue::make_lattice(), 1,
               {.threads = rules_of(silk_along({{0, 0, 1}, {0.01, 0, 1}}))});
  EXPECT_FALSE(plain.state().threads);
  Bytes bytes, more;
  plain.write_snapshot(bytes);
  threaded.write_snapshot(more);
  EXPECT_GT(more.size(), bytes.size() + 11 * 48);
}

}  // namespace
}  // namespace trocar::thread
