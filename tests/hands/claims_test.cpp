// The rules of claims, on a table of ten nodes.

#include "server/tissue/hands/claims.h"

#include <gtest/gtest.h>

namespace trocar::hands {
namespace {

using tool::Verb;

class Claims : public ::testing::Test {
 protected:
  struct Hand {
    Verb verb = Verb::None;
    std::vector<NodeIndex> core;
    Tick last_sample = 0;
    bool is_present = false;
  };

  static std::vector<NodeIndex> nodes(std::initializer_list<int> values) {
    std::vector<NodeIndex> out;
    for (const int v : values) out.push_back(NodeIndex(v));
    return out;
  }
  void set(int tool, Verb verb, std::initializer_list<int> core = {}) {
    hands[static_cast<std::size_t>(tool)] = {verb, nodes(core), tick, true};
  }
  void fall_silent(int tool) { silent.push_back(tool); }
  // One tick in which every hand that is not silent sends a sample.
  void advance(Tick ticks = 1) {
    for (Tick i = 0; i < ticks; ++i) {
      ++tick;
      std::vector<ClaimRequest> requests;
      for (std::size_t t = 0; t < hands.size(); ++t) {
        if (!hands[t].is_present) continue;
        if (std::find(silent.begin(), silent.end(), static_cast<int>(t)) == silent.end())
          hands[t].last_sample = tick;
        requests.push_back({ToolSlot{static_cast<std::uint8_t>(t)}, hands[t].verb,
                            hands[t].last_sample, hands[t].core});
      }
      table.update(tick, requests, events);
    }
  }
  const Claim& claim(int tool) { return table.claim(ToolSlot{static_cast<std::uint8_t>(tool)}); }
  bool holds(int tool) { return claim(tool).phase == ClaimPhase::Held; }
  int owner(int node) { return table.owner(NodeIndex(node)).value; }

  ClaimTable table{10};
  std::array<Hand, 8> hands;
  std::vector<int> silent;
  std::vector<ClaimEvent> events;
  Tick tick = 0;
};

TEST_F(Claims, AGraspIsExclusiveAndAllOrNothing) {
  set(0, Verb::Grasp, {1, 2, 3});
  advance();
  ASSERT_TRUE(holds(0));
  set(2, Verb::Grasp, {3, 4, 5});
  advance();
  EXPECT_FALSE(holds(2));
  EXPECT_EQ(owner(3), 0);
  EXPECT_EQ(owner(4), 0xff) << "nothing of a refused core is held";
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[1].outcome, ClaimOutcome::RefusedHeld);
  EXPECT_EQ(events[1].holder.value, 0);
  advance(50);
  EXPECT_EQ(events.size(), 2u) << "a refusal is told once, not once per retry";
}

TEST_F(Claims, RetriesSucceedWhenTheHolderLetsGoInTheSameTick) {
  set(0, Verb::Grasp, {1, 2});
  advance();
  set(2, Verb::Grasp, {2});
  advance();
  set(0, Verb::None);
  advance();
  EXPECT_TRUE(holds(2));
  EXPECT_EQ(owner(1), 0xff);
  EXPECT_EQ(owner(2), 2);
}

TEST_F(Claims, TheFirstRefusedIsServedFirstThenTheLowestSlot) {
  set(0, Verb::Grasp, {5});
  advance();
  set(6, Verb::Grasp, {5});
  advance();
  set(2, Verb::Grasp, {5});
  set(4, Verb::Grasp, {5});
  advance();
  set(0, Verb::None);
  advance();
  EXPECT_TRUE(holds(6));
  set(6, Verb::None);
  advance();
  EXPECT_TRUE(holds(2));
  EXPECT_FALSE(holds(4));
}

TEST_F(Claims, NothingInReachIsRefusedWithThatReasonAndRetried) {
  set(0, Verb::Grasp);
  advance(3);
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].outcome, ClaimOutcome::RefusedNothingInReach);
  set(0, Verb::Grasp, {7});
  advance();
  EXPECT_TRUE(holds(0));
}

TEST_F(Claims, PushBlocksNobodysGrasp) {
  set(0, Verb::Push);
  set(2, Verb::Grasp, {1});
  advance();
  EXPECT_TRUE(holds(0));
  EXPECT_TRUE(holds(2));
}

TEST_F(Claims, ASilentHoldersCoreMayBeTakenAfter250TicksAndFadesIn100) {
  set(0, Verb::Grasp, {1, 2});
  advance();
  fall_silent(0);
  set(2, Verb::Grasp, {2, 3});
  advance(kLeaseTicks);
  EXPECT_TRUE(holds(0));
  EXPECT_FALSE(holds(2));
  advance();
  EXPECT_TRUE(holds(2));
  EXPECT_EQ(claim(0).phase, ClaimPhase::Ramping);
  EXPECT_EQ(owner(1), 0xff) << "the rest of the core is free too";
  EXPECT_EQ(table.strength(ToolSlot{0}, tick), 1.0f);
  EXPECT_EQ(table.strength(ToolSlot{0}, tick + 50), 0.5f);
  EXPECT_EQ(table.strength(ToolSlot{0}, tick + kTakeoverRampTicks), 0.0f);
  EXPECT_EQ(std::count_if(events.begin(), events.end(),
                          [](const auto& e) { return e.outcome == ClaimOutcome::TakenOver; }),
            1);
}

TEST_F(Claims, AnUncontestedSilentGraspIsHeldFor2000TicksThenFadesIn500) {
  set(0, Verb::Grasp, {1});
  advance();
  fall_silent(0);
  advance(kAbandonTicks);
  EXPECT_TRUE(holds(0));
  advance();
  EXPECT_EQ(claim(0).phase, ClaimPhase::Ramping);
  EXPECT_EQ(table.strength(ToolSlot{0}, tick + 250), 0.5f);
  advance(kAbandonRampTicks);
  EXPECT_EQ(claim(0).phase, ClaimPhase::None);
}

TEST_F(Claims, AShortRadioGapChangesNothing) {
  set(0, Verb::Grasp, {1});
  advance();
  fall_silent(0);
  advance(kAbandonTicks - 1);
  silent.clear();
  advance(10);
  EXPECT_TRUE(holds(0));
  EXPECT_EQ(events.size(), 1u);
}

TEST_F(Claims, ALeaversCoreIsFreeAtOnce) {
  set(0, Verb::Grasp, {1, 2});
  advance();
  set(2, Verb::Grasp, {1});
  advance();
  ASSERT_FALSE(holds(2));
  table.leave(ToolSlot{0}, tick + 1);
  hands[0].is_present = false;
  advance();
  EXPECT_TRUE(holds(2));
  EXPECT_GT(table.strength(ToolSlot{0}, tick), 0.9f) << "its force fades, it does not jump";
}

TEST_F(Claims, ASilentToolAsksForNothing) {
  set(0, Verb::Grasp, {1});
  advance();
  set(2, Verb::Grasp, {1});
  advance();
  fall_silent(2);
  advance(kLeaseTicks + 10);
  set(0, Verb::None);
  advance();
  EXPECT_FALSE(holds(2));
}

TEST_F(Claims, StateRoundTripsThroughAnArchive) {
  set(0, Verb::Grasp, {1, 2});
  set(4, Verb::Grasp, {2});
  advance();
  Bytes bytes;
  auto writer = world::StateArchive::writing(bytes);
  table.visit_state(writer);
  ClaimTable other(10);
  auto reader = world::StateArchive::reading(bytes);
  other.visit_state(reader);
  ASSERT_TRUE(reader.ok() && reader.at_end());
  Bytes again;
  auto rewriter = world::StateArchive::writing(again);
  other.visit_state(rewriter);
  EXPECT_EQ(bytes, again);
}

TEST_F(Claims, ACutHoldsWhatIsNearTheBladeAndStopsAtWhatAnotherHolds) {
  set(0, Verb::Grasp, {5, 6});
  set(2, Verb::Cut, {1, 2});
  advance();
  ASSERT_TRUE(holds(0));
  ASSERT_TRUE(holds(2));
  EXPECT_EQ(owner(1), 2);
  set(2, Verb::Cut, {3, 4});
  advance();
  EXPECT_TRUE(holds(2));
  EXPECT_EQ(owner(1), 0xff) << "what the blade has left is free";
  EXPECT_EQ(owner(4), 2);
  const auto told = events.size();
  set(2, Verb::Cut, {4, 5});
  advance(20);
  EXPECT_FALSE(holds(2));
  EXPECT_EQ(owner(4), 0xff);
  ASSERT_EQ(events.size(), told + 1) << "told once";
  EXPECT_EQ(events.back().outcome, ClaimOutcome::RefusedHeld);
  EXPECT_EQ(events.back().holder.value, 0);
  set(0, Verb::None);
  advance(2);
  EXPECT_TRUE(holds(2)) << "free again, the blade goes on";
  EXPECT_EQ(owner(5), 2);
}

TEST_F(Claims, OfTwoBladesOnOneCoreTheSecondIsStopped) {
  set(0, Verb::Cut, {1, 2});
  set(2, Verb::Cut, {2, 3});
  advance();
  EXPECT_TRUE(holds(0));
  EXPECT_FALSE(holds(2));
  EXPECT_EQ(events.back().holder.value, 0);
  set(0, Verb::Cut, {});
  advance();
  EXPECT_TRUE(holds(0)) << "in the air it may go on";
  EXPECT_TRUE(holds(2));
  set(0, Verb::Cut, {2});
  advance();
  EXPECT_FALSE(holds(0));
  fall_silent(2);
  advance(kLeaseTicks + 2);
  EXPECT_TRUE(holds(0)) << "nobody waits for a silent blade";
}

// The rules do not promise more than this; docs/ownership-model.md says why.

TEST_F(Claims, AGraspOfTwoNodesMayStarveBetweenTwoThatTakeTurns) {
  set(0, Verb::Grasp, {1});
  set(2, Verb::Grasp, {2});
  advance();
  set(4, Verb::Grasp, {1, 2});
  advance();
  const auto let_go_and_grasp_again = [this](int tool, std::initializer_list<int> core) {
    set(tool, Verb::None);
    advance();
    EXPECT_FALSE(holds(4));
    set(tool, Verb::Grasp, core);
    advance();
    EXPECT_TRUE(holds(tool)) << "who waits for more than this node keeps none of it free";
  };
  for (int turn = 0; turn < 50; ++turn) {
    let_go_and_grasp_again(0, {1});
    let_go_and_grasp_again(2, {2});
  }
  EXPECT_FALSE(holds(4));
  set(0, Verb::None);
  set(2, Verb::None);
  advance();
  EXPECT_TRUE(holds(4)) << "both let go at once";
}

TEST_F(Claims, ABladeThatHoldsGoesBeforeWhoWaits) {
  set(0, Verb::Cut, {1});
  set(2, Verb::Cut);
  advance();
  set(4, Verb::Grasp, {1});
  advance();
  for (int turn = 0; turn < 50; ++turn) {
    set(0, Verb::Cut);
    set(2, Verb::Cut, {1});
    advance();
    EXPECT_EQ(owner(1), 2);
    set(0, Verb::Cut, {1});
    set(2, Verb::None);
    advance();
    EXPECT_EQ(owner(1), 0);
    set(2, Verb::Cut);
    advance();
  }
  EXPECT_FALSE(holds(4)) << "two blades pass the node to and fro";
}

TEST_F(Claims, AStoppedBladeWaitsATickForOneThatMovesAway) {
  set(0, Verb::Cut, {1});
  set(2, Verb::Cut, {2});
  advance();
  set(0, Verb::Cut, {2});
  set(2, Verb::Cut, {3});
  advance();
  EXPECT_FALSE(holds(0));
  EXPECT_EQ(owner(2), 0xff);
  advance();
  EXPECT_TRUE(holds(0));
}

TEST_F(Claims, TwoHandsOfTwoToolsMayWaitForEachOther) {
  set(0, Verb::Grasp, {1});
  set(2, Verb::Grasp, {2});
  advance();
  set(1, Verb::Grasp, {2});
  set(3, Verb::Grasp, {1});
  advance(5000);
  EXPECT_FALSE(holds(1) || holds(3)) << "until one of them opens";
  set(2, Verb::None);
  advance();
  EXPECT_TRUE(holds(1));
}

}  // namespace
}  // namespace trocar::hands
