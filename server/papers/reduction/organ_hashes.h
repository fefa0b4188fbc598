#pragma once

// Hashes of what a reduced model is made of: of an organ's mesh, and of its elasticity.

#include <cstdint>

#include "server/organs/organ/organ.h"

namespace trocar::reduction {

// XXH3-64 over rest positions, tets and fixed nodes; over laws and constants of elasticity and
// relaxation, and where they hold.
std::uint64_t mesh_hash(const organ::Organ& organ);
std::uint64_t elasticity_hash(const organ::Organ& organ);

}  // namespace trocar::reduction
