#pragma once

// Moves the threads of a session by one tick. All threads are one chain of nodes and one matrix
// (chain_solver.h), solved in up to kMostNewtonSteps Newton steps; where pairs of thread move fast
// the tick is divided. Equal states and tools give equal bits. No allocation once warm. One thread.

#include <array>
#include <span>

#include "server/tissue/thread/grips.h"
#include "server/tissue/thread/self_contact.h"
#include "server/tissue/thread/solids.h"

namespace trocar::thread {

inline constexpr int kMostNewtonSteps = 10;
inline constexpr double kToleranceM = 1e-7;  // of a node's move

struct ThreadReport {
  int steps = 0, newton_steps = 0;
  std::size_t kept_nodes = 0;         // the most in a solve
  std::size_t dropped_pairs = 0;      // beyond the limits
  std::uint32_t broken = 0, cut = 0;  // segments
  bool is_restored = false;           // a step was not finite, and was put back
};

// On a tool, of all thread that it holds and touches.
struct ToolPull {
  Vec3d force_n, torque_nm;  // world frame; torque about the tip
};

class ThreadStep {
 public:
  explicit ThreadStep(const Rules& rules);

  // time_s: at the end of the tick.
  ThreadReport run(std::span<const ToolNow> tools, double time_s, Threads& threads);

  const ToolPull& pull(ToolSlot tool) const { return pulls_[tool.value]; }
  std::span<const Grips::EndForces> end_forces() const { return grips_.end_forces(); }
  Vec3d force_on_peg_n(std::size_t peg) const { return solids_.force_on_peg_n(peg); }
  const Elasticity& elasticity() const { return elasticity_; }

 private:
  void note_poses(std::span<const ToolNow> tools, Threads& threads, bool is_begin) const;
  void place_tools(std::span<const ToolNow> tools, const Threads& threads, double from, double to);
  void run_steps(int steps, std::span<const ToolNow> tools, double time_s, Threads& threads,
                 ThreadReport& report);
  void step(Threads& threads, ThreadReport& report);
  void newton(Threads& threads, ThreadReport& report);
  std::uint32_t cut(std::span<const ToolNow> tools, Threads& threads) const;
  std::uint32_t part_broken(Threads& threads) const;
  void sum_pulls(std::span<const ToolNow> tools);

  Elasticity elasticity_;
  SelfContact self_contact_;
  Solids solids_;
  Grips grips_;
  ChainSolver solver_;
  Threads begun_;  // as the tick began
  std::vector<Solid> tool_solids_;
  std::array<ToolPull, kMaxTools> pulls_{};
};

}  // namespace trocar::thread
