#pragma once

// The last part of a node's step, for eight nodes: from gradient and block to a move.

#include "server/tissue/dynamics/energy.h"

namespace trocar::dynamics {

// A step of one node beyond this, m, is as broken as one that is not finite.
inline constexpr float kMaxNodeStep = 1.0f;

struct NodeMove {
  Vec8 dx;                    // m; zero in lanes that do not move
  Float8 squared;             // of the gradient before, N^2; likewise
  std::uint8_t rejected = 0;  // lanes whose step was not sound
};

// factor: minus the over-relaxation.
[[gnu::always_inline]] inline NodeMove move_of(const NodeStep8& step, Float8 factor,
                                               std::uint8_t lanes) {
  const Vec8 dx = solve_positive_definite(step.block, step.gradient) * factor;
  const Float8 squared = dot8(step.gradient, step.gradient);
  const Float8 is_sound =
      _mm256_and_ps(is_below(squared, 3e38f), is_below(dot8(dx, dx), kMaxNodeStep * kMaxNodeStep));
  const Float8 moves = _mm256_and_ps(mask_of(lanes), is_sound);
  return {{where(moves, dx.x), where(moves, dx.y), where(moves, dx.z)},
          where(moves, squared),
          static_cast<std::uint8_t>(lanes & ~bits_of(is_sound))};
}

}  // namespace trocar::dynamics
