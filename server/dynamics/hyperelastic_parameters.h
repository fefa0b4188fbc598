#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "common/scene/organ.h"

namespace trocar::dynamics {

// Per material, as scene::material_at() counts; nothing where it is none of those meant.
using HyperelasticParameters = std::vector<std::optional<scene::NeoHookeanParameters>>;

template <typename Is>
HyperelasticParameters hyperelastic_parameters(const scene::Organ& organ, Is&& is) {
  HyperelasticParameters parameters(organ.regions.size() + 1);
  for (std::size_t m = 0; m < parameters.size(); ++m) {
    const auto& material = scene::material_at(organ, static_cast<std::uint16_t>(m));
    if (is(material)) parameters[m] = scene::neo_hookean_parameters(material);
  }
  return parameters;
}

}  // namespace trocar::dynamics
