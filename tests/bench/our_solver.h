#pragma once

// The engine as the benchmarks use it; everything that names its parts is in our_solver.cpp, so
// that a new law, boundary mode or thread count is plugged in there.
//
// An organ under constant nodal forces, every free node swept in each step. Not thread-safe;
// threads beyond the caller's are the engine's own.

#include <cstdint>
#include <memory>
#include <span>

#include "server/organs/organ/organ.h"

namespace trocar::bench {

enum class Law { Springs, LinearTets, NeoHookean, NeoHookeanAveraged };
inline constexpr Law kLaws[] = {Law::Springs, Law::LinearTets, Law::NeoHookean,
                                Law::NeoHookeanAveraged};
const char* name_of(Law law);
// The organ with this law instead of its own, the rest of its material as it is.
organ::Organ with_law(organ::Organ organ, Law law);

struct SolverOptions {
  Law law = Law::Springs;
  std::uint32_t sweeps = 4;
  float over_relaxation = 1.5f;
  std::uint32_t threads = 1;
  // Above 0: sweep until the residual is at most this, N (`sweeps` is then the limit).
  float tolerance_n = 0;
};

// Whether this build of the engine can do it; what it cannot is left out of the results.
bool has(Law law);
std::uint32_t max_threads();

class OurSolver {
 public:
  OurSolver(const organ::Organ& organ, const SolverOptions& options);
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

}  // namespace trocar::bench
