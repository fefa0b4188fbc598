#pragma once

// A material says what tissue is made of, in SI units. Its `elastic_law` decides which energies of
// server/tissue/dynamics it becomes.

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/index.h"
#include "common/math/vec3.h"
#include "server/organs/material/hyperelastic_material.h"

namespace trocar::material {

enum class ElasticLaw : std::uint8_t {
  Springs = 0,     // along tet edges or links (Choi 2002, Nakao 2003)
  TensorMass = 1,  // linear elasticity, matrices per node and edge (Cotin 2000); small rotations
  NeoHookean = 2,  // tets: C10 (I1 - 3) - 2 C10 (J - 1) + K/2 (J - 1)^2
  Measured = 3,    // tets: Material::measured
};

// How the stiffness of a spring follows from the material.
enum class SpringLaw : std::uint8_t {
  Constant = 0,          // the same k for every spring (Choi 2002, Nakao 2003)
  VolumeConsistent = 1,  // k from Young's modulus, edge length and the volume of the tets around it
};

inline constexpr double kLeastTearStretch = 1.05;

struct Material {
  double density_kg_m3 = 1060;
  SpringLaw spring_law = SpringLaw::VolumeConsistent;
  double spring_stiffness_n_m = 100;  // SpringLaw::Constant
  double young_modulus_pa = 4000;     // all but SpringLaw::Constant
  // Damping of each node in proportion to its velocity: d_i = rate x m_i (Choi 2002 eq. 1).
  double node_damping_per_s = 10;
  // Damping of the length of each edge, of tets as of links: b = time x k (Kelvin-Voigt); k of the
  // volume-consistent law where the elasticity is not of springs. Stretched within T, tissue is too
  // stiff by about time / T while it moves.
  double edge_damping_time_s = 0.0001;
  ElasticLaw elastic_law = ElasticLaw::Springs;
  double poisson_ratio = 0.45;  // TensorMass, NeoHookean; springs have 1/4 whatever is asked
  // Measured: a reduced polynomial, not split; young_modulus_pa and poisson_ratio say what it is to
  // small strains at first (use_measured).
  HyperelasticMaterial measured{};
  // NeoHookean, Measured: strain averaged over each node's tets, against locking
  // (dynamics::NodalStrain).
  bool has_averaged_strain = false;
  // Transverse isotropy (springs) and tension (all laws): along a spring at the angle a to the
  // fibres,
  //   k = k0 (1 + (fibre_stiffness_ratio - 1) cos^2 a),
  //   rest length = length (1 - tension - fibre_tension cos^2 a)    (Nakao 2003 eq. 3);
  // tets accordingly (topology::stress_free_shape).
  // Of any length; zero: none. Organ::fibre_directions go before it.
  Vec3d fibre_direction{};
  double fibre_stiffness_ratio = 1;
  double tension = 0;
  double fibre_tension = 0;
  // A blade's work per area of wound, one side, J/m^2; about that of liver (Azar & Hayward 2008).
  double cut_energy_j_m2 = 150;
  // Shear stress on each side of a blade that slides in it, Pa; of the order at which needles slide
  // in liver (Okamura 2004: some 10 N per metre of one 1.65 mm thick).
  double blade_friction_pa = 2000;
  // How far it can be stretched, length over length at rest, before it tears; 0: it never does.
  double tear_stretch = 0;

  bool operator==(const Material&) const = default;
};

// Part of an organ with a material of its own. An element belongs to the last region that holds all
// of its nodes, else to the organ's own material.
struct MaterialRegion {
  std::string name;
  Material material;
  std::vector<NodeIndex> nodes;  // ascending, distinct
  // The tets that are in it, likewise; empty: all whose four nodes are in it.
  std::vector<TetIndex> tets;
  std::string look{};  // of a part: what it is drawn as; empty: as any

  bool operator==(const MaterialRegion&) const = default;
};

inline bool is_hyperelastic(const Material& material) {
  return material.elastic_law == ElasticLaw::NeoHookean ||
         material.elastic_law == ElasticLaw::Measured;
}
// Makes tissue of a measured law, with its density, damping and what it is to blades as before.
void use_measured(const HyperelasticMaterial& measured, Material& material);

// Lame's first and second parameter of linear elasticity, Pa.
struct LameParameters {
  double lambda_pa = 0, mu_pa = 0;
};
LameParameters lame_parameters(const Material& material);

// Constants of the neo-Hookean law whose response to small strains e is that of linear elasticity,
// W = mu e:e + lambda/2 (tr e)^2: the bracket C10 (I1 - 3) - 2 C10 (J - 1) is
// 2 C10 e:e - C10 (tr e)^2 to second order, so 2 C10 = mu and K = lambda + mu. Of a measured law
// its own.
struct NeoHookeanParameters {
  double c10_pa = 0, bulk_modulus_pa = 0;
};
NeoHookeanParameters neo_hookean_parameters(const Material& material);

}  // namespace trocar::material
