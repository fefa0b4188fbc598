#pragma once

// Keys of [material] that mean something with some elastic laws only.

#include <array>
#include <span>
#include <string_view>

#include "server/organs/material/material.h"

namespace trocar::material {

struct LawKey {
  std::string_view key;
  bool springs, tensor_mass, neo_hookean, measured;
  const char* why;  // it does not apply to the others
};

inline constexpr std::array kLawKeys{
    LawKey{"spring_stiffness_n_m", true, false, false, false, "is of springs"},
    LawKey{"young_modulus_pa", true, true, true, false, "is what a measured material has"},
    LawKey{"poisson_ratio", false, true, true, false,
           "is of tets with elastic_law = \"tensor-mass\" or \"neo-hookean\": springs have 1/4 "
           "whatever is asked"},
    LawKey{"measured", false, false, false, true, "is of elastic_law = \"measured\""},
    LawKey{"averaged_strain", false, false, true, true,
           "is of elastic_law = \"neo-hookean\" or \"measured\""},
    LawKey{"fibre_stiffness_ratio", true, false, false, false, "is of springs"}};

constexpr bool applies(const LawKey& key, ElasticLaw law) {
  switch (law) {
    case ElasticLaw::Springs:
      return key.springs;
    case ElasticLaw::TensorMass:
      return key.tensor_mass;
    case ElasticLaw::NeoHookean:
      return key.neo_hookean;
    case ElasticLaw::Measured:
      return key.measured;
  }
  return false;
}

// Why the key means nothing with this law; empty where it does.
constexpr std::string_view why_not_with(std::string_view key, ElasticLaw law) {
  for (const auto& known : kLawKeys)
    if (known.key == key && !applies(known, law)) return known.why;
  return "";
}

}  // namespace trocar::material
