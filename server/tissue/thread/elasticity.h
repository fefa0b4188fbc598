#pragma once

// A thread's stretch, bending and inertia: one step of implicit Euler is the minimum of
//
//   sum m (1 + c dt)/(2 dt^2) |x_i - y_i|^2  +  sum EA/(2 l) (|e_i| - l)^2
//     +  sum EI/(2 l^3) |x_(i-1) - 2 x_i + x_(i+1)|^2  +  damping of bending
//
// with e_i from node i to the next, and y_i where the node would go by itself. There is no twist: a
// bite turns a needle by half a turn, and free ends unwind (Michell 1889 gives a ring over two
// turns before it leaves its plane).
//
// The geometric stiffness of a segment is from the tension that the last Newton step has solved
// for, and in the first from that of the tick before: where nodes have moved sideways, the tension
// of the segments between them may be off by orders of magnitude.

#include <vector>

#include "server/tissue/thread/chain_solver.h"
#include "server/tissue/thread/threads.h"

namespace trocar::thread {

inline constexpr double kDrag = 10;              // 1/s, of mass; our choice
inline constexpr double kBendingSeconds = 2e-3;  // damping of bending over its stiffness; likewise

// Constants of each node, and of the segment that begins there.
struct NodeFigures {
  explicit NodeFigures(const Rules& rules);

  std::vector<double> mass_kg, stretch_n, bending_nm2, breaks_n, self_friction;
};

class Elasticity {
 public:
  explicit Elasticity(const Rules& rules) : figures_(rules), gravity_m_s2_(rules.gravity_m_s2) {}

  // Begins a step of time: nodes go where they would by themselves.
  void begin(double dt_s, Threads& threads);
  // Adds forces and their derivatives at the present places.
  void add(const Threads& threads, ChainSolver& solver) const;
  // Nodes go where the solver has them, or a part of the way.
  void move(const ChainSolver& solver, double part, Threads& threads);
  // Ends it: velocities and tensions.
  void end(Threads& threads) const;
  // Puts a step back whose result is not finite; nodes then rest.
  void undo(Threads& threads) const;

  const NodeFigures& figures() const { return figures_; }
  double dt_s() const { return dt_s_; }
  // Returns where nodes were when the step began, m.
  const std::vector<Vec3d>& before() const { return before_; }
  double elastic_energy_j(const Threads& threads) const;
  double kinetic_energy_j(const Threads& threads) const;

 private:
  void add_segment(std::size_t i, const Threads& threads, ChainSolver& solver) const;
  void add_bend(std::size_t i, const Threads& threads, ChainSolver& solver) const;

  NodeFigures figures_;
  Vec3d gravity_m_s2_;
  double dt_s_ = 0;
  std::vector<Vec3d> before_, aims_;
  std::vector<double> solved_n_;  // tension per segment
};

}  // namespace trocar::thread
