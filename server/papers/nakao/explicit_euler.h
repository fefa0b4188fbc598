#pragma once

// Symplectic Euler, the papers' integrator (Nakao 2003 eq. 2: velocity first), as a reference:
//   v += dt/m (loads - gradient - damping), x += dt v.
// Stable only for short steps: for a mode of angular frequency w and damping c = rate + time w^2
// (nodal and Kelvin-Voigt),  dt <= (sqrt(c^2 + 4 w^2) - c) / w^2. The highest w comes from power
// iteration at rest; a step beyond the limit is refused, because positions would only grow. No
// tools. One thread.

#include <vector>

#include "server/tissue/dynamics/block_descent.h"

namespace trocar::nakao {

class ExplicitEuler {
 public:
  ExplicitEuler(const organ::Organ& organ, const world::World& world);

  double stable_dt_s() const { return stable_dt_s_; }
  double highest_frequency_rad_s() const { return highest_frequency_; }

  // Advances all nodes that are not fixed. dt in s, at most stable_dt_s().
  void step(double dt, world::World& world, const dynamics::ExternalLoads& loads = {});

 private:
  std::vector<Vec3f> gradients(std::span<const dynamics::Float4> x);
  double find_highest_frequency();

  const organ::Organ& organ_;
  dynamics::Tissue tissue_;
  std::vector<float> masses_, damping_rates_;
  std::vector<std::uint8_t> is_free_;
  std::vector<dynamics::Float4> x_, start_;
  double highest_frequency_ = 0, stable_dt_s_ = 0;
};

}  // namespace trocar::nakao
