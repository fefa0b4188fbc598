#pragma once

// Hands that do anything: they join, leave and return, fall silent, send late, move along a line
// and change their verbs, at random. What they send goes through the inbox of a session.

#include <array>
#include <functional>
#include <vector>

#include "server/session/participants/inbox.h"
#include "tests/support/random.h"

namespace trocar::hands::testing {

struct HandsPlan {
  int hands = 6;
  std::uint32_t change_period = 400;  // ticks from one change of a tool to the next, on average
  // Gives where a tool is and how it lies, at a place between 0 and 1.
  std::function<Pose(double)> pose_at;
  tool::ToolShape shape;
};

class RandomHands {
 public:
  RandomHands(std::uint64_t seed, HandsPlan plan) : random_(seed), plan_(std::move(plan)) {
    hands_.resize(static_cast<std::size_t>(plan_.hands));
  }

  // Does what happens before `tick`.
  void act(Tick tick, participants::SimulationInbox& inbox) {
    for (std::size_t i = 0; i < hands_.size(); ++i)
      act(tick, static_cast<std::uint8_t>(i), hands_[i], inbox);
  }

  struct Counts {
    int joins = 0, leaves = 0, silences = 0, changes = 0, late = 0;
  };
  const Counts& counts() const { return counts_; }

 private:
  static constexpr Tick kSamplePeriod = 8;

  struct Hand {
    bool is_here = false;
    Tick silent_until = 0;
    Tick late_until = 0;  // until then its samples wait, and arrive together
    std::array<tool::ToolSample, kToolsPerHand> tools;
    std::vector<hands::ToolInput> on_the_way;
  };

  bool happens(std::uint32_t once_in) { return random_.below(once_in) == 0; }

  // Around the limits of the leases, and far from them.
  Tick silence_ticks() {
    constexpr std::array<Tick, 7> kAround{5, 100, 250, 300, 1000, 2000, 2400};
    return kAround[random_.below(kAround.size())] + random_.below(12) - 5;
  }

  void act(Tick tick, std::uint8_t slot, Hand& hand, participants::SimulationInbox& inbox) {
    if (!hand.is_here) {
      if (happens(700)) join(tick, slot, hand, inbox);
      return;
    }
    if (happens(9000)) return leave(slot, hand, inbox);
    if (happens(1500)) hand.silent_until = tick + silence_ticks(), ++counts_.silences;
    if (happens(2000)) hand.late_until = tick + random_.below(320), ++counts_.late;
    for (auto& sample : hand.tools)
      if (happens(plan_.change_period)) change(sample);
    if (tick < hand.silent_until) return;
    if (tick % kSamplePeriod == slot % kSamplePeriod)
      for (int i = 0; i < kToolsPerHand; ++i)
        hand.on_the_way.push_back({tool_slot({slot}, i), hand.tools[static_cast<std::size_t>(i)]});
    if (tick < hand.late_until) return;
    for (const auto& input : hand.on_the_way) inbox.push_sample(input);
    hand.on_the_way.clear();
  }

  void join(Tick tick, std::uint8_t slot, Hand& hand, participants::SimulationInbox& inbox) {
    if (!inbox.try_push_join(
            {.slot = {slot}, .tool_count = 2, .shapes = {plan_.shape, plan_.shape}}))
      return;
    hand = {
        .is_here = true, .silent_until = tick, .late_until = tick, .tools = {}, .on_the_way = {}};
    for (auto& sample : hand.tools) change(sample);
    ++counts_.joins;
  }

  void leave(std::uint8_t slot, Hand& hand, participants::SimulationInbox& inbox) {
    inbox.push_leave({slot});
    hand.is_here = false;
    ++counts_.leaves;
  }

  void change(tool::ToolSample& sample) {
    ++counts_.changes;
    if (happens(2)) sample.world_from_tool = plan_.pose_at(random_.unit());
    sample.verb = static_cast<tool::Verb>(random_.below(tool::kVerbCount));
  }

  trocar::testing::Random random_;
  const HandsPlan plan_;
  std::vector<Hand> hands_;
  Counts counts_;
};

}  // namespace trocar::hands::testing
