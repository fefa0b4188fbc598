#pragma once

// Threads as tests lay them out.

#include <vector>

#include "server/tissue/thread/thread_step.h"

namespace trocar::thread {

// A thread of 3-0 silk along the path, with both ends free.
ThreadRule silk_along(std::vector<Vec3d> path_m);

// The rules of one thread without gravity.
Rules rules_of(ThreadRule rule);

// A thread that moves by itself.
struct LaidThread {
  explicit LaidThread(const Rules& rules) : threads(rules), step(rules) {}

  ThreadReport tick(std::span<const ToolNow> tools = {}) {
    time_s += 1e-3;
    return step.run(tools, time_s, threads);
  }
  void run(int ticks) {
    for (int k = 0; k < ticks; ++k) tick();
  }
  double length_m() const;
  double largest_strain() const;
  std::uint64_t hash();

  Threads threads;
  ThreadStep step;
  double time_s = 0;
};

// A tool whose jaws are closed, of 0.5 mm radius, with its shaft in that direction from the tip.
ToolNow jaws_at(const Vec3d& tip_m, const Vec3d& shaft);

// A thread of silk around a peg along z, with a load on its start; its end, drawn off along the
// tangent, is held.
Rules around_peg(double angle, double friction, double radius_m, double load_n, double speed);

// Returns the largest strain of a slack thread, half a circle between two hands, one of which goes
// off at 1 m/s and stops.
double strain_at_a_jerk();

// A throw: half turns of one strand about the other, 3 or 5, by one hand or the other.
struct Throw {
  int half_turns = 3, hand = 1;
};

// A thread that goes around a frictionless post, its ends cross in throws above it, and two hands
// hold them. It has come to rest as laid.
class KnotInHands {
 public:
  KnotInHands(const std::vector<Throw>& throws, double self_friction);

  // A tick in which both hands go apart, and aside, at this speed.
  ThreadReport pull(double speed, const Vec3d& aside = {});
  // Returns the pull at a hand, in the mean of both.
  double force_n() const;
  // Returns the pull of the loop on the post: twice its tension.
  double loop_n() const;
  // Counts those of the two sides of the loop's lowest point, as seen along z: no motion
  // changes but one through thread or around an end.
  int signed_crossings() const;
  void take_hands_of(const KnotInHands& other);

  LaidThread laid;

 private:
  ToolNow hands_[2];
  Vec3d at_m_[2];
};

}  // namespace trocar::thread
