#pragma once

// The off-line solver solves a problem: elements, materials, and what is held. A degree of freedom
// is 3 node + axis. SI units.

#include <cstdint>
#include <string>
#include <vector>

#include "server/lab/finite_elements/element_mesh.h"
#include "server/organs/organ/organ.h"

namespace trocar::finite_elements {

using Vector = Eigen::VectorXd;

struct Problem {
  ElementMesh mesh;
  std::vector<material::HyperelasticMaterial> materials;
  std::vector<double> densities_kg_m3;           // per material
  std::vector<std::uint16_t> element_materials;  // per element
  std::vector<std::uint32_t> held_dofs;          // ascending, distinct
  double damping_per_s = 0;                      // force on a node: -rate x mass x velocity

  std::size_t dof_count() const { return 3 * mesh.node_count(); }
  const material::HyperelasticMaterial& material_of(std::size_t element) const {
    return materials[element_materials[element]];
  }
};

// Makes a problem of one material everywhere, in which nothing is held.
Problem make_problem(ElementMesh mesh, const material::HyperelasticMaterial& material,
                     double density_kg_m3 = 1060);

// To this solver, hyperelastic tissue is a measured law: its own, or the live solver's neo-Hookean
// law of linear elastic constants written as one.
material::HyperelasticMaterial law_of(const material::Material& material, const std::string& name);

// Error names the first number that is out of range; every material is validated.
Status validate(const Problem& problem);

// XXH3-64 over all numbers: names the problem in files of its state.
std::uint64_t hash_of(const Problem& problem);

}  // namespace trocar::finite_elements
