#include "server/lab/finite_elements/problem.h"

#include <algorithm>
#include <cmath>

#include "common/base/hash_array.h"

namespace trocar::finite_elements {
namespace {

std::vector<double> numbers_of(const material::HyperelasticMaterial& m) {
  std::vector<double> numbers{static_cast<double>(m.energy), static_cast<double>(m.split),
                              m.exponent, m.bulk_modulus_pa};
  numbers.insert(numbers.end(), m.coefficients_pa.begin(), m.coefficients_pa.end());
  for (const auto& term : m.relaxation) {
    numbers.push_back(term.weight);
    numbers.push_back(term.relaxation_time_s);
  }
  return numbers;
}

}  // namespace

material::HyperelasticMaterial law_of(const material::Material& material, const std::string& name) {
  if (material.elastic_law == material::ElasticLaw::Measured) return material.measured;
  const auto [c10_pa, bulk_modulus_pa] = material::neo_hookean_parameters(material);
  material::HyperelasticMaterial law;
  law.name = name;
  law.coefficients_pa[0] = c10_pa;
  law.bulk_modulus_pa = bulk_modulus_pa;
  return law;
}

Problem make_problem(ElementMesh mesh, const material::HyperelasticMaterial& material,
                     double density_kg_m3) {
  Problem problem;
  problem.element_materials.assign(mesh.element_count(), 0);
  problem.mesh = std::move(mesh);
  problem.materials = {material};
  problem.densities_kg_m3 = {density_kg_m3};
  return problem;
}

Status validate(const Problem& p) {
  const auto wrong = [](const std::string& what) {
    return Error{ErrorCode::BadFile, "finite elements: " + what};
  };
  if (p.mesh.element_count() == 0) return wrong("the organ has no tets");
  if (p.materials.empty() || p.materials.size() != p.densities_kg_m3.size() ||
      p.element_materials.size() != p.mesh.element_count())
    return wrong("materials and elements do not belong together");
  for (const auto& material : p.materials)
    if (auto s = material::validate(material); !s) return s;
  for (const double density : p.densities_kg_m3)
    if (!(density > 0) || !std::isfinite(density)) return wrong("a density is not above 0");
  for (const auto index : p.element_materials)
    if (index >= p.materials.size()) return wrong("an element's material does not exist");
  const auto& held = p.held_dofs;
  if (std::adjacent_find(held.begin(), held.end(), std::greater_equal<>()) != held.end() ||
      (!held.empty() && held.back() >= p.dof_count()))
    return wrong("held degrees of freedom are not distinct, ascending and in range");
  if (held.size() == p.dof_count()) return wrong("nothing is free to move");
  if (!(p.damping_per_s >= 0) || !std::isfinite(p.damping_per_s))
    return wrong("the damping is not a number from 0 up");
  return {};
}

std::uint64_t hash_of(const Problem& p) {
  StateHasher hasher;
  hash_array(hasher, p.mesh.rest_positions);
  hash_array(hasher, p.mesh.nodes);
  hash_array(hasher, p.element_materials);
  hash_array(hasher, p.held_dofs);
  hash_array(hasher, p.densities_kg_m3);
  hash_array(hasher, std::vector<double>{p.damping_per_s});
  for (const auto& material : p.materials) hash_array(hasher, numbers_of(material));
  return hasher.digest();
}

}  // namespace trocar::finite_elements
