#pragma once

// How many threads share a tick's work: one while one is enough, more while something would be
// given up for a tick's time and more do help. Whether they help is tried, for other programs want
// the same processors, and a thread that has to wait for one holds up all.
//
// Laws, once a tick:
//   alone    while a tick of the team takes less than kLightLoad of its time with all its threads
//            together, until a tick takes one thread more than kHeavyLoad;
//   trial    while the last 64 ticks or so were short of time, more than half of them, one begins
//            kSoon ticks after one that changed something, and after one that did not, twice as
//            late as the last time, up to kLate. It is of twice as many threads; or of half as many
//            where there are no more, or after a trial of more that changed nothing. There are more
//            while each has at least kIdleEach of a processor that nobody uses. kBlocks times
//            kBlockTicks heavy ticks are done in turn with the team as it is and as it might be;
//   keep     more where they took at most kWorthwhile of the time, fewer where they took at most
//            kAsGood, each without its dearest block, so that a stall decides nothing.
// Pure arithmetic on what it is given. Results do not depend on it, so it is not journalled.

#include <array>
#include <cstdint>

namespace trocar::control {

class TeamSize {
 public:
  static constexpr double kLightLoad = 0.25, kHeavyLoad = 0.35;
  static constexpr std::uint32_t kBlocks = 16, kBlockTicks = 16;
  static constexpr std::uint32_t kSoon = 250, kLate = 16'000;
  static constexpr double kWorthwhile = 0.9, kAsGood = 1.03, kIdleEach = 0.5;

  // most: threads that there may be.
  explicit TeamSize(unsigned most) : most_(most) {}

  // Returns how many share the next tick.
  unsigned count() const { return is_light_ ? 1 : (is_other_turn() ? other_ : team_); }
  // After each tick. load: what it took, in ticks of real time. is_short: something was given up
  // for time in it, or time fell behind.
  void observe(double load, bool is_short);
  // Tells how many processors stood idle lately, in the mean; none at first.
  void set_idle(double processors) { idle_ = processors; }

 private:
  bool is_other_turn() const { return other_ != 0 && tried_ticks_ / kBlockTicks % 2 == 1; }
  // Returns whom to try; the team itself where there is nobody.
  unsigned next_other() const;
  void begin_trial();
  void end_trial();

  const unsigned most_;
  unsigned team_ = 1;
  unsigned other_ = 0;             // that is tried; 0: none is
  std::uint32_t tried_ticks_ = 0;  // of the trial
  // Sums of the trial's loads, with the team and with the other.
  struct Side {
    double sum = 0, block = 0, dearest = 0;
    void add(double load, bool ends_block);
  };
  std::array<Side, 2> sides_;
  std::uint32_t since_trial_ = kSoon, wait_ = kSoon;
  double short_share_ = 0, idle_ = 0;
  bool is_light_ = true;
  bool tries_fewer_ = false;
};

}  // namespace trocar::control
