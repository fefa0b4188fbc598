#pragma once

// Whoever slows time gives way first, and nobody else feels it: while ticks take longer than there
// is time for, tools that go faster through tissue than a surgeon's wait. A blade stops where it
// is: its hand is held back (blades/blades.h), and what it has planned is cut meanwhile. A tip that
// presses, and jaws that hold, go on slowly (contact/contact_list.h). Everybody is told.
//
// Laws, once a tick, with the mean load of the last 64 ticks or so, in ticks of real time:
//   wait   when it is above kHighLoad, each tool whose mean speed is above kOrdinary_m_s;
//   go on  one tool each kReleaseEvery ticks, which began to wait first: after kWait ticks, or
//          kWaitAgain where it waited within the last kForget, if the load is below kLowLoad;
//          after kMostWait whatever it is, so that nobody waits for the work of others.
// A wait is its hand's, whatever instrument it is handed meanwhile.
// Pure arithmetic on what it is given. What it decides is an input of the tick and journalled.

#include <array>
#include <cstdint>
#include <span>

#include "common/base/ids.h"
#include "common/base/tick.h"
#include "common/math/vec3.h"

namespace trocar::step {
class Simulation;
}

namespace trocar::control {

class ToolWaits {
 public:
  static constexpr float kOrdinary_m_s = 0.1f;  // in tissue: a surgeon's quick stroke
  static constexpr double kHighLoad = 0.9, kLowLoad = 0.5;
  static constexpr Tick kWait = 128, kWaitAgain = 256, kMostWait = 1000;
  static constexpr Tick kReleaseEvery = 32, kForget = 2000;

  // After each tick. speeds_m_s: of each tool in tissue; 0 where it is free or stopped. load: what
  // the tick took, in ticks of real time.
  void observe(std::span<const float, kMaxTools> speeds_m_s, double load);
  // Returns the bits of tools that wait in the next tick.
  std::uint32_t waiting() const;
  // And of those that waited within a second: nobody can read a shorter word.
  std::uint32_t waited_lately() const;

 private:
  struct ToolWait {
    float speed_m_s = 0;  // mean
    Tick since = 0;       // it waits, or waited
    Tick wait = 0;        // for at least so long
    Tick ended = 0;       // when it waited last; 0: it never did
    bool waits = false;
  };

  void begin(ToolWait& tool) const;
  bool may_go_on(const ToolWait& tool) const;
  void release_one();

  std::array<ToolWait, kMaxTools> tools_;
  double load_ = 0;
  Tick now_ = 0, released_ = 0;
};

// Reads how fast each tool went through tissue in the last tick, m/s: a blade through what is
// whole, and the hand of a tip that presses or of jaws that hold. Who is carried along by others,
// or catches up, is not fast.
class TissueSpeeds {
 public:
  // After each tick.
  std::array<float, kMaxTools> read(const step::Simulation& simulation);

 private:
  std::array<Vec3f, kMaxTools> tips_;  // of hands, in the tick before
};

}  // namespace trocar::control
