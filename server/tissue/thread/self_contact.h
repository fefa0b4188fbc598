#pragma once

// Thread meets thread: segments at least kApart from each other along it, and those of different
// threads. Each pair that may meet within a step has a plane, from its closest points when the step
// begins, that keeps the two kContactM apart; it holds them before they touch, too, so nothing
// passes through while a pair moves by less than about kContactM in a step. steps_needed() says
// into how many a tick has to be divided for that.
//
// kContactM is more than a thread is thick: with a quarter of a segment's length square knots came
// undone at 0.5 m/s.
//
// Pairs near each other are listed by the middles of segments, and listed anew when a node has
// moved by half of the list's slack. Results do not depend on when.

#include <span>
#include <vector>

#include "server/tissue/thread/elasticity.h"
#include "server/tissue/thread/friction.h"

namespace trocar::thread {

inline constexpr double kContactM = 0.5e-3;       // between centre lines
inline constexpr std::size_t kApart = 3;          // segments
inline constexpr std::size_t kMostTouching = 64;  // nodes; beyond, what overlaps least is dropped
inline constexpr int kMostSteps = 5;              // of a tick

class SelfContact {
 public:
  SelfContact();

  // Returns into how many steps of time a tick is to be divided, by how fast pairs move now.
  int steps_needed(const Threads& threads, double tick_s);
  // Begins a step, after Elasticity::begin().
  void begin(const Threads& threads);
  // Replaces the state's pairs by those that may meet, as far as nodes have moved in the step.
  void find(const Elasticity& elasticity, Threads& threads);
  void add(const Threads& threads, ChainSolver& solver) const;
  // Ends the step: friction's memory.
  void end(Threads& threads) const;

  std::size_t dropped() const { return dropped_; }  // pairs beyond the limits, in the last find()
  // Two segments are nearest to each other there: parts of their lengths.
  struct Nearest {
    double first, second;
  };
  // At one of the two where they are parallel.
  static Nearest nearest(const Vec3d& a, const Vec3d& a_end, const Vec3d& b, const Vec3d& b_end);

 private:
  struct Listed {
    std::uint32_t first, second;
  };
  struct Plane {
    Vec3d normal;   // of the second towards the first
    Vec3d apart_m;  // of the closest points when the step began
    double friction = 0;
  };
  struct Candidate {
    std::uint32_t first, second;
    double place_first, place_second;
    Vec3d apart_m;
    double distance_m;
  };

  void refresh_list(const std::vector<Vec3d>& x, const Threads& threads);
  void list_from(std::uint32_t first, double reach_m);
  void gather(const Elasticity& elasticity, const Threads& threads);
  void drop_beyond_limits();
  void take_over_friction(Pairs& now) const;
  Vec3d apart_now(const Pairs& pairs, std::size_t k, const Threads& threads) const;

  std::vector<Listed> list_;
  std::vector<Vec3d> listed_at_, middles_;
  std::vector<std::uint32_t> chain_end_;  // per segment: the node where its thread ends
  std::vector<Candidate> candidates_;
  std::vector<std::uint32_t> order_;
  std::vector<std::uint8_t> is_touching_;
  std::vector<Plane> planes_;  // per pair
  Pairs before_;
  std::size_t dropped_ = 0;
};

}  // namespace trocar::thread
