#pragma once

// The keys of [material], once: how they are written, what range they have, and which of them mean
// something with some elastic laws only. Scenarios, files, reports and fits read them from here.

#include <array>
#include <span>
#include <string_view>

#include "server/organs/material/material.h"

namespace trocar::material {

// Tension and fibre tension may reach this, alone and together.
inline constexpr double kMaxTension = 0.9;

// A key with a number. Its unit is in its name.
struct NumberKey {
  std::string_view key;
  const char* title;  // for messages about an organ
  double Material::*member;
  double low, high;
};

inline constexpr std::array kNumberKeys{
    NumberKey{"density_kg_m3", "density (kg/m^3)", &Material::density_kg_m3, 1, 30000},
    NumberKey{"spring_stiffness_n_m", "spring stiffness (N/m)", &Material::spring_stiffness_n_m, 0,
              1e9},
    NumberKey{"young_modulus_pa", "Young's modulus (Pa)", &Material::young_modulus_pa, 0, 1e12},
    NumberKey{"node_damping_per_s", "node damping (1/s)", &Material::node_damping_per_s, 0, 1e6},
    NumberKey{"edge_damping_time_s", "edge damping time (s)", &Material::edge_damping_time_s, 0,
              100},
    NumberKey{"poisson_ratio", "Poisson's ratio", &Material::poisson_ratio, 0, 0.4999},
    NumberKey{"fibre_stiffness_ratio", "fibre stiffness ratio", &Material::fibre_stiffness_ratio, 0,
              1000},
    NumberKey{"tension", "tension", &Material::tension, 0, kMaxTension},
    NumberKey{"fibre_tension", "fibre tension", &Material::fibre_tension, 0, kMaxTension},
    NumberKey{"cut_energy_j_m2", "cut energy (J/m^2)", &Material::cut_energy_j_m2, 0, 1e6},
    NumberKey{"blade_friction_pa", "blade friction (Pa)", &Material::blade_friction_pa, 0, 1e6},
    // Between 0, which is never, and kLeastTearStretch nothing is allowed.
    NumberKey{"tear_stretch", "tear stretch", &Material::tear_stretch, 0, 100}};

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
