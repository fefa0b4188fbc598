#pragma once

// The organ that a reduced model was made of, by hashes. The model is good for the mesh and the
// elasticity whose hashes it names; density, damping and what blades meet may change.

#include <cstdint>

#include "common/base/result.h"
#include "server/organs/organ/organ.h"

namespace trocar::reduction {

inline constexpr std::size_t kMaxReducedModes = 64;

// XXH3-64 over rest positions, tets and fixed nodes; over laws and constants of elasticity and
// relaxation, and where they hold.
std::uint64_t mesh_hash(const organ::Organ& organ);
std::uint64_t elasticity_hash(const organ::Organ& organ);

// A reduction says this of its organ.
struct ReducedOrgan {
  std::uint32_t node_count = 0;
  std::uint64_t mesh_hash = 0, elasticity_hash = 0;
};
// Whether it is this one.
Status check_organ(const ReducedOrgan& of, const organ::Organ& organ);

}  // namespace trocar::reduction
