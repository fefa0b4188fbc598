#pragma once

#include <algorithm>

#include "server/organs/organ/organ.h"

namespace trocar::organ {

// Whether the organ's material or that of a region is so.
template <typename Predicate>
bool any_material(const Organ& organ, Predicate&& is) {
  return is(organ.material) ||
         std::ranges::any_of(organ.regions, [&](const auto& r) { return is(r.material); });
}

}  // namespace trocar::organ
