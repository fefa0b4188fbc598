#pragma once

// A block with a local reduction that is made for it.

#include <cstdint>
#include <memory>

#include "server/organs/organ/local_reduction.h"

namespace trocar::reduce::testing {

struct ReducedBlock {
  // patches: at most; 0: as many as it needs. Some seconds.
  explicit ReducedBlock(std::uint32_t patches = 0);

  const Vec3d& centre(std::size_t patch) const {
    return organ.mesh.rest_positions[local->patches[patch].centre.value];
  }
  // The patch whose centre is the n-th nearest, from 0 on, to the middle of the top.
  std::size_t near_top(std::size_t n) const;

  organ::Organ organ;
  std::shared_ptr<const organ::LocalReduction> local;
};

}  // namespace trocar::reduce::testing
