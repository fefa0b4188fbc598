#pragma once

// Linear elasticity on a pulled box in double precision, solved to convergence by conjugate
// gradients: the answer that linear solvers on the same mesh and step must give. Independent of the
// engine. O(steps x iterations x edges).

#include <array>
#include <vector>

#include "tests/bench/pulled_box.h"

namespace trocar::bench {

class ReferenceFem {
 public:
  explicit ReferenceFem(const PulledBox& box);

  // Mean x displacement of the loaded face, m: at rest under the load, or after `steps` steps of
  // implicit Euler from rest.
  double static_displacement();
  double displacement_after(int steps, double dt_s);

 private:
  using Vector = std::vector<Vec3d>;
  using Block = std::array<double, 9>;
  void assemble();
  // y = (mass_factor M + stiffness_factor K) x on free nodes; zero on fixed ones.
  void multiply(double mass_factor, double stiffness_factor, const Vector& x, Vector& y) const;
  // x is the initial guess; ends at a relative residual of 1e-9.
  void solve(double mass_factor, double stiffness_factor, const Vector& b, Vector& x) const;
  double face_displacement(const Vector& u) const;

  const PulledBox& box_;
  std::vector<std::uint8_t> is_fixed_;
  // Rows of 3x3 blocks: the node itself first, then its neighbours.
  std::vector<std::uint32_t> offsets_, columns_;
  std::vector<Block> blocks_;
};

}  // namespace trocar::bench
