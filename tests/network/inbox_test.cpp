// The inbox against a plain model: what reaches the tick is what a simulation that saw every item
// in order would hold; and what happens when it is full.

#include "server/session/participants/inbox.h"

#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <random>
#include <set>
#include <thread>

namespace trocar::participants {
namespace {

hands::HandJoin join_of(std::uint8_t slot, float tag) {
  hands::HandJoin join{{slot}, 2, {}};
  join.shapes[0].radius_m = tag;
  return join;
}

hands::ToolInput sample_of(std::uint8_t tool, float tag) {
  hands::ToolInput input{{tool}, {}};
  input.sample.world_from_tool.position.x = tag;
  return input;
}

// Tenants by their tag, the newest change of each tool, and the newest sample since that.
struct Model {
  std::map<int, float> tenants;
  std::map<int, float> changes, samples;

  void change(int tool, float tag) {
    changes[tool] = tag;
    samples.erase(tool);
  }
  void leave(int slot) {
    tenants.erase(slot);
    for (int tool = slot * kToolsPerHand; tool < (slot + 1) * kToolsPerHand; ++tool) {
      changes.erase(tool);
      samples.erase(tool);
    }
  }
  bool operator==(const Model&) const = default;
};

TEST(Inbox, a_tick_sees_the_same_as_one_who_saw_every_item) {
  for (unsigned seed = 0; seed < 300; ++seed) {
    std::mt19937 random(seed);
    SimulationInbox inbox;
    Model truth, admitted;
    hands::TickInputs inputs;
    float tag = 0;
    for (int tick = 0; tick < 20; ++tick) {
      for (auto actions = random() % 40; actions > 0; --actions) {
        const auto slot = static_cast<std::uint8_t>(random() % 3);
        tag += 1;
        if (!truth.tenants.contains(slot)) {
          ASSERT_TRUE(inbox.try_push_join(join_of(slot, tag)));
          truth.tenants[slot] = tag;
        } else if (random() % 4 == 0) {
          inbox.push_leave({slot});
          truth.leave(slot);
        } else if (random() % 4 == 0) {
          const auto tool = static_cast<std::uint8_t>(slot * kToolsPerHand + random() % 2);
          ASSERT_TRUE(inbox.try_push_change({{tool}, {.radius_m = tag}}));
          truth.change(tool, tag);
        } else {
          const auto tool = static_cast<std::uint8_t>(slot * kToolsPerHand + random() % 2);
          inbox.push_sample(sample_of(tool, tag));
          truth.samples[tool] = tag;
        }
      }
      inbox.drain(inputs);
      std::set<int> left, joined, changed, sampled;
      for (const auto slot : inputs.leaves) {
        ASSERT_TRUE(left.insert(slot.value).second) << "twice in one tick";
        ASSERT_TRUE(admitted.tenants.contains(slot.value)) << "a leave of nobody";
        admitted.leave(slot.value);
      }
      for (const auto& join : inputs.joins) {
        ASSERT_TRUE(joined.insert(join.slot.value).second);
        ASSERT_FALSE(admitted.tenants.contains(join.slot.value)) << "a join into a taken slot";
        admitted.tenants[join.slot.value] = join.shapes[0].radius_m;
      }
      for (const auto& change : inputs.changes) {
        ASSERT_TRUE(changed.insert(change.tool.value).second);
        admitted.change(change.tool.value, change.shape.radius_m);
      }
      for (const auto& sample : inputs.samples) {
        ASSERT_TRUE(sampled.insert(sample.tool.value).second);
        admitted.samples[sample.tool.value] = sample.sample.world_from_tool.position.x;
      }
      ASSERT_EQ(admitted, truth) << "seed " << seed << " tick " << tick;
    }
  }
}

TEST(Inbox, when_full_samples_are_dropped_and_counted_and_everybody_can_still_leave) {
  SimulationInbox inbox;
  for (std::uint8_t slot = 0; slot < kMaxHands; ++slot)
    ASSERT_TRUE(inbox.try_push_join(join_of(slot, 1)));
  for (int i = 0; i < 5000; ++i) inbox.push_sample(sample_of(0, static_cast<float>(i)));
  EXPECT_EQ(inbox.counters().samples_taken + inbox.counters().samples_dropped, 5000u);
  EXPECT_GE(inbox.counters().samples_dropped, 5000 - SimulationInbox::kCapacity);
  // Slot 0 churns until the inbox says stop; then all leave.
  std::size_t rejoins = 0;
  inbox.push_leave({0});
  while (inbox.try_push_join(join_of(0, 2))) {
    inbox.push_leave({0});
    ASSERT_LT(++rejoins, SimulationInbox::kReservedForJoins);
  }
  for (std::uint8_t slot = 1; slot < kMaxHands; ++slot) inbox.push_leave({slot});
  hands::TickInputs inputs;
  inbox.drain(inputs);
  EXPECT_TRUE(inputs.empty()) << "all came and went within one tick";
  EXPECT_TRUE(inbox.try_push_join(join_of(0, 3))) << "there is room again";
}

TEST(Inbox, two_threads_lose_nothing_but_superseded_samples) {
  SimulationInbox inbox;
  constexpr int kSamples = 200'000;
  std::atomic<bool> is_done{false};
  std::thread producer([&] {
    for (int i = 1; i <= kSamples; ++i)
      inbox.push_sample(sample_of(static_cast<std::uint8_t>(i % 4), static_cast<float>(i)));
    is_done = true;
  });
  std::array<float, 4> newest{};
  hands::TickInputs inputs;
  const auto take = [&] {
    inbox.drain(inputs);
    for (const auto& input : inputs.samples) {
      const float tag = input.sample.world_from_tool.position.x;
      EXPECT_GT(tag, newest[input.tool.value]) << "older than one already seen";
      newest[input.tool.value] = tag;
    }
  };
  while (!is_done) take();
  producer.join();
  take();
  EXPECT_TRUE(inbox.counters().samples_dropped > 0 || newest[0] == kSamples);
}

}  // namespace
}  // namespace trocar::participants
