#pragma once

// Organs that nobody tuned for, each of another kind, for laws that hold of any organ.

#include <cstdint>

#include "server/organs/organ/organ.h"

namespace trocar::step::testing {

inline constexpr int kLawOrgans = 6;

// kind: less than kLawOrgans. Neo-Hookean, with averaged strain; nodes are moved about by the seed.
organ::Organ law_organ(int kind, std::uint64_t seed);
const char* law_organ_name(int kind);

}  // namespace trocar::step::testing
