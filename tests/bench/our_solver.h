#pragma once

// The engine as the benchmarks use it; everything that names its parts is in our_solver.cpp, so
// that a new law, boundary mode or thread count is plugged in there.
//
// OurSolver: an organ under constant nodal forces, every free node swept in each step (`whole`).
// OurSession: a whole simulated tick with tools, as the server runs it, in a boundary mode.
// Not thread-safe; threads beyond the caller's are the engine's own.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/scene/organ.h"

namespace trocar::bench {

enum class Law { Springs, LinearTets, NeoHookean, NeoHookeanAveraged };
inline constexpr Law kLaws[] = {Law::Springs, Law::LinearTets, Law::NeoHookean,
                                Law::NeoHookeanAveraged};
const char* name_of(Law law);
// The organ with this law instead of its own, the rest of its material as it is.
scene::Organ with_law(scene::Organ organ, Law law);

struct SolverOptions {
  Law law = Law::Springs;
  std::uint32_t sweeps = 4;
  float over_relaxation = 1.5f;
  std::uint32_t threads = 1;
  // Above 0: sweep until the residual is at most this, N (`sweeps` is then the limit).
  float tolerance_n = 0;
};

// What this build of the engine can do; what it cannot is left out of the results.
bool has(Law law);
bool has_graded_mode();
std::uint32_t max_threads();

class OurSolver {
 public:
  OurSolver(const scene::Organ& organ, const SolverOptions& options);
  ~OurSolver();

  void step(std::span<const Vec3f> forces_n);  // 1 ms
  std::span<const Vec3f> displacements() const;
  std::uint64_t state_hash() const;
  std::uint32_t last_sweeps() const;
  float last_residual_n() const;

 private:
  struct Engine;
  std::unique_ptr<Engine> engine_;
};

enum class BoundaryMode { Frozen, Graded };
const char* name_of(BoundaryMode mode);

struct SessionOptions {
  Law law = Law::Springs;
  BoundaryMode mode = BoundaryMode::Frozen;
  std::uint32_t depth = 6;
  std::uint32_t nodes = 1200;
  std::uint32_t sweeps = 4;
  std::uint32_t threads = 1;
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
  OurSession(scene::Organ organ, std::span<const BenchTool> tools, const SessionOptions& options);
  ~OurSession();

  TickTimes tick();
  TickCounts counts() const;
  // Force of the tissue on each tool, N, at each publication so far (every 16th tick): tools of the
  // first, then of the second, ...
  const std::vector<Vec3f>& published_forces() const;
  std::span<const Vec3f> displacements() const;
  std::uint64_t state_hash() const;

 private:
  struct Engine;
  std::unique_ptr<Engine> engine_;
};

}  // namespace trocar::bench
