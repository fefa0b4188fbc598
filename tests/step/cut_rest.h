#pragma once

// How cut tissue comes to rest: organs that nobody tuned for are cut at random, the blade leaves,
// and nobody touches them any more.

#include <cstdint>
#include <string>

#include "server/tissue/world/world.h"
#include "tests/step/law_organs.h"

namespace trocar::step::testing {

enum class RestLoad { None, Tension, Gravity };  // 4 %; 9.81 m/s^2
inline constexpr int kRestLoads = 3, kRestCuts = 10;

// This is what moves at the end of a tick.
struct Motion {
  double kinetic_j = 0, fastest_m_s = 0;
  bool is_asleep = true;
};
Motion motion_of(const world::World& world);

struct CutRest {
  std::string name;
  int asleep_after = -1;  // ticks; negative: not within kRestTicks
  Motion motion;          // after kRestTicks
  std::size_t tets = 0;
  double tick_us = 0;  // thread CPU time, median of the last half
  std::uint64_t hash = 0;
};

inline constexpr int kRestTicks = 2000;

// Ten strokes with the default edge at 0.1 m/s, by the seed.
CutRest run_cut_rest(int organ, RestLoad load, std::uint64_t seed);

}  // namespace trocar::step::testing
