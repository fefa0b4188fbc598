#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "server/organs/organ/organ.h"

namespace trocar::dynamics {

// Per material, as organ::material_at() counts; nothing where it is none of those meant.
using HyperelasticParameters = std::vector<std::optional<material::NeoHookeanParameters>>;

template <typename Is>
HyperelasticParameters hyperelastic_parameters(const organ::Organ& organ, Is&& is) {
  HyperelasticParameters parameters(organ.regions.size() + 1);
  for (std::size_t m = 0; m < parameters.size(); ++m) {
    const auto& material = organ::material_at(organ, static_cast<std::uint16_t>(m));
    if (is(material)) parameters[m] = material::neo_hookean_parameters(material);
  }
  return parameters;
}

}  // namespace trocar::dynamics
