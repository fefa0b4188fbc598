#pragma once

// The server's own ticks (server/tissue/step) with tools that move by themselves, as the benchmarks
// use them. Everything of a tick is in it but input from outside. One caller.

#include <cstdint>
#include <span>
#include <vector>

#include "common/base/tick.h"
#include "server/organs/organ/organ.h"
#include "server/tissue/hands/inputs.h"
#include "server/tissue/step/simulation.h"
#include "tests/bench/our_solver.h"

namespace trocar::bench {

using world::Boundary;

struct SessionOptions {
  Law law = Law::Springs;
  Boundary boundary = Boundary::Frozen;
  std::uint32_t depth = 6;
  std::uint32_t nodes = 1200;
  std::uint32_t sweeps = 4;
  std::uint32_t threads = 1;
  bool is_whole = false;  // every free node is swept `sweeps` times, whatever the limits say
};

// A tool of a benchmark: it grasps or presses one place on the surface, to and fro.
struct BenchTool {
  Vec3f place;             // a surface point at rest, m
  Vec3f outward{0, 1, 0};  // unit
  bool grasps = false;
  float radius_m = 0.008f, reach_m = 0.010f;
  float amplitude_m = 0.010f;  // pressed in or pulled out by 0.4 to 1 of it, period 0.5 s
};

// CPU time of the calling thread per part of a tick, s.
struct TickTimes {
  double init = 0;   // inputs admitted, contacts found
  double queue = 0;  // nodes and layers collected
  double solve = 0;
  double rest = 0;  // claims, hash, publication
  double mechanics() const { return init + queue + solve; }
};

struct TickCounts {
  std::uint32_t queue_nodes = 0, active_nodes = 0, contact_nodes = 0, faults = 0;
};

class OurSession {
 public:
  OurSession(organ::Organ organ, std::span<const BenchTool> tools, const SessionOptions& options);

  TickTimes tick();
  TickCounts counts() const;
  // Force of the tissue on each tool, N, at each publication so far (every 16th tick): tools of the
  // first, then of the second, ...
  const std::vector<Vec3f>& published_forces() const { return forces_; }
  std::span<const Vec3f> displacements() const { return simulation_.state().world.displacements; }
  std::uint64_t state_hash() const { return simulation_.state_hash(); }
  std::size_t state_bytes() const;  // of a snapshot: what a later tick depends on
  std::uint32_t far_sweeps() const { return report_.solve.figures.far_sweeps; }  // of the last tick

 private:
  void sample_tools();

  step::Simulation simulation_;
  step::TickDecisions decisions_;
  step::TickReport report_;
  std::vector<BenchTool> tools_;
  hands::TickInputs inputs_;
  std::vector<Vec3f> forces_;
};

}  // namespace trocar::bench
