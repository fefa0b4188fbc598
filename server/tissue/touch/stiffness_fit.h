#pragma once

// The stiffness that a tool meets, from its own motion: a least-squares fit of the change of force
// over the change of place in 32 ticks, which forgets in a quarter of a second. A hand feels tissue
// at that time scale. A step of one tick would meet five times as much, because the neighbours of
// what is touched have not moved yet.

#include <array>

#include "common/math/vec3.h"

namespace trocar::touch {

class StiffnessFit {
 public:
  // Once a tick while the tool touches; at: of its tip, force_n: on it.
  void add(const Vec3f& at_m, const Vec3f& force_n);
  void clear() { *this = {}; }

  // N/m, symmetric; where the tool has not moved, it is `guess`. No direction of it is negative:
  // a force that falls while the tool pulls on is of tissue that tears, and no spring pushes.
  SymMat3f stiffness(const SymMat3f& guess) const;

 private:
  static constexpr std::size_t kSpan = 32;  // ticks
  struct Reading {
    Vec3f at, force;
  };

  std::array<Reading, kSpan> readings_{};
  std::size_t count_ = 0;
  SymMat3f moved_;             // forgotten mean of dx dx^T, m^2
  std::array<Vec3f, 3> rows_;  // forgotten mean of -dF dx^T, N m, by row
};

}  // namespace trocar::touch
