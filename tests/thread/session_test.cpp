// Threads in the tick: state, snapshot, mark, and a hand that holds one.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>

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

// Two hands beside a thread on a floor, whose start is held.
class TwoHands {
 public:
  explicit TwoHands(const tool::ToolShape& first = {}, const tool::ToolShape& second = {})
      : simulation(catalogue::make_lattice(), 1, {.threads = rules()}), shapes_{first, second} {}

  struct Hand {
    tool::Verb verb;
    float x_m;
  };
  void run(int ticks, const Hand& first, const Hand& second) {
    for (int k = 0; k < ticks; ++k) {
      hands::TickInputs inputs;
      for (std::uint8_t i = 0; i < 2; ++i) {
        const auto& hand = i == 0 ? first : second;
        if (simulation.current_tick() == 0)
          inputs.joins.push_back({.slot = {i}, .tool_count = 1, .shapes = {shapes_[i], {}}});
        const Pose pose{{hand.x_m, 0.002f, kZ}, rotation_from_z({0, 1, 0})};
        inputs.samples.push_back({tool_slot({i}, 0), {pose, hand.verb}, 0});
      }
      simulation.tick(inputs, {});
      if (const auto frame = simulation.pop_frame())
        events.insert(events.end(), frame->claim_events.begin(), frame->claim_events.end());
    }
  }
  std::vector<wire::ClaimOutcome> outcomes_of(std::uint8_t hand) const {
    std::vector<wire::ClaimOutcome> outcomes;
    for (const auto& event : events)
      if (event.tool == tool_slot({hand}, 0)) outcomes.push_back(event.outcome);
    return outcomes;
  }
  std::set<std::uint32_t> nodes_of(std::uint8_t hand) const {
    const auto& holds = simulation.state().threads->holds;
    std::set<std::uint32_t> nodes;
    for (std::size_t k = 0; k < holds.nodes.size(); ++k)
      if (holds.tools[k] == tool_slot({hand}, 0)) nodes.insert(holds.nodes[k]);
    return nodes;
  }

  step::Simulation simulation;
  std::vector<hands::ClaimEvent> events;

 private:
  static constexpr float kZ = 0.3f;
  static Rules rules() {
    auto rules = rules_of(silk_along({{-0.04, 0, kZ}, {0.04, 0, kZ}}));
    rules.threads[0].start.is_held = true;
    rules.gravity_m_s2 = {0, -9.81, 0};
    rules.floor_y_m = 0;
    return rules;
  }
  std::array<tool::ToolShape, 2> shapes_;
};

using tool::Verb;
using wire::ClaimOutcome;

TEST(ThreadInTheTick, TwoHandsHoldOneThreadAtTwoStretchesAndAreToldSo) {
  TwoHands hands;
  hands.run(200, {Verb::Grasp, 0}, {Verb::Grasp, 0.02f});
  const auto first = hands.nodes_of(0), second = hands.nodes_of(1);
  EXPECT_FALSE(first.empty());
  EXPECT_FALSE(second.empty());
  for (const auto node : first) EXPECT_FALSE(second.contains(node));
  hands.run(32, {Verb::None, 0}, {Verb::Grasp, 0.02f});
  EXPECT_TRUE(hands.nodes_of(0).empty());
  EXPECT_FALSE(hands.nodes_of(1).empty());
  EXPECT_EQ(hands.outcomes_of(0), (std::vector{ClaimOutcome::Granted, ClaimOutcome::Released}));
  EXPECT_EQ(hands.outcomes_of(1), (std::vector{ClaimOutcome::Granted}));
}

TEST(ThreadInTheTick, WhoFindsNoOtherThreadIsToldWhoHoldsIt) {
  TwoHands hands({}, {.reach_m = 0.0015f});
  hands.run(200, {Verb::Grasp, 0}, {Verb::None, 0});
  hands.run(16, {Verb::Grasp, 0}, {Verb::Grasp, 0});
  EXPECT_TRUE(hands.nodes_of(1).empty());
  ASSERT_EQ(hands.outcomes_of(1), (std::vector{ClaimOutcome::RefusedHeld}));
  EXPECT_EQ(hands.events.back().holder, tool_slot({0}, 0));
}

TEST(ThreadInTheTick, JawsThatAreDrawnOffItsEndHaveLostItAndOpenFirst) {
  TwoHands hands({.grip_n = 0.5f});
  hands.run(200, {Verb::Grasp, 0.037f}, {Verb::None, 0});
  for (int k = 0; k < 200; ++k)
    hands.run(1, {Verb::Grasp, 0.037f + 1e-4f * static_cast<float>(k)}, {Verb::None, 0});
  EXPECT_TRUE(hands.nodes_of(0).empty());
  EXPECT_EQ(hands.outcomes_of(0), (std::vector{ClaimOutcome::Granted, ClaimOutcome::Slipped}));
  hands.run(32, {Verb::Grasp, 0.035f}, {Verb::None, 0});
  EXPECT_TRUE(hands.nodes_of(0).empty());
  hands.run(16, {Verb::None, 0.035f}, {Verb::None, 0});
  hands.run(16, {Verb::Grasp, 0.035f}, {Verb::None, 0});
  EXPECT_FALSE(hands.nodes_of(0).empty());
}

TEST(ThreadInTheTick, WhatIsHeldIsHandedOver) {
  TwoHands hands;
  hands.run(200, {Verb::Grasp, 0}, {Verb::None, 0.02f});
  const auto held = hands.nodes_of(0);
  hands::TickInputs inputs;
  inputs.handover = hands::Handover{.from = tool_slot({0}, 0), .to = tool_slot({1}, 0)};
  hands.simulation.tick(inputs, {});
  EXPECT_TRUE(hands.nodes_of(0).empty());
  EXPECT_EQ(hands.nodes_of(1), held);
}

TEST(ThreadInTheTick, AFrameShowsItAsItIs) {
  LiftedThread lifted;
  step::SharedFrame frame;
  while (frame == nullptr) {
    lifted.tick();
    frame = lifted.simulation.pop_frame();
  }
  const auto picture = wire::decode_threads(frame->threads);
  ASSERT_TRUE(picture.ok()) << picture.error().message;
  ASSERT_EQ(picture->places.size(), lifted.threads().node_count());
  for (std::size_t i = 0; i < picture->places.size(); ++i)
    EXPECT_LT(length(to_double(wire::to_metres(picture->places[i])) - lifted.threads().places_m[i]),
              30e-6);
  EXPECT_LT(frame->threads.size(), 2 * picture->places.size());
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
