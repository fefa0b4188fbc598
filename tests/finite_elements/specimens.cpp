#include "tests/finite_elements/specimens.h"

#include <cmath>

namespace trocar::finite_elements::testing {

const HyperelasticMaterial& liver() {
  return *material::find_measured_material("human_liver_nava2008");
}

HyperelasticMaterial liver_without_relaxation() {
  auto material = liver();
  material.relaxation.clear();
  return material;
}

HyperelasticMaterial neo_hookean(double young_pa, double poisson) {
  const double mu = young_pa / (2 * (1 + poisson));
  const double lambda = 2 * mu * poisson / (1 - 2 * poisson);
  HyperelasticMaterial material;
  material.name = "neo-hookean";
  material.coefficients_pa[0] = mu / 2;
  material.bulk_modulus_pa = lambda + mu;
  return material;
}

Specimen::Specimen(const std::array<int, 3>& cells, double spacing_m, ElementOrder order,
                   const HyperelasticMaterial& material, const Shape& shape) {
  const auto organ = scenario::make_block({cells[0] + 1, cells[1] + 1, cells[2] + 1, spacing_m});
  TROCAR_ASSERT(organ.ok());
  mesh_ = organ->mesh;
  const Vec3d corner = mesh_.rest_positions.front();
  for (auto& p : mesh_.rest_positions) {
    p = p - corner;
    if (shape) p = shape(p);
  }
  problem_ = make_problem(make_elements(mesh_, mesh_.rest_positions, order), material);
  forces_ = Vector::Zero(static_cast<Eigen::Index>(problem_.dof_count()));
}

void Specimen::hold(const Where& where, int axis, const std::function<double(const Vec3d&)>& move) {
  const auto& p = problem_.mesh.rest_positions;
  for (std::uint32_t i = 0; i < p.size(); ++i)
    if (where(p[i])) held_[3 * i + static_cast<std::uint32_t>(axis)] = move(p[i]);
}

void Specimen::hold_all_axes(const Where& where) {
  for (int axis = 0; axis < 3; ++axis) hold(where, axis);
}

void Specimen::pull(const Where& where, const Vec3d& traction_pa) {
  std::vector<std::uint8_t> is_there;
  for (const auto& p : mesh_.rest_positions) is_there.push_back(where(p) ? 1 : 0);
  const auto shares = area_shares(mesh_, problem_.mesh, is_there);
  for (std::size_t i = 0; i < shares.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      forces_[static_cast<Eigen::Index>(3 * i) + axis] += shares[i] * component(traction_pa, axis);
}

Problem Specimen::problem() const {
  Problem problem = problem_;
  for (const auto& [dof, move] : held_) problem.held_dofs.push_back(dof);
  return problem;
}

Loads Specimen::loads(double share) const {
  Loads loads{share * forces_, {}};
  for (const auto& [dof, move] : held_) loads.held_moves.push_back(share * move);
  return loads;
}

Where plane(int axis, double at_m) {
  return [=](const Vec3d& p) { return std::abs(component(p, axis) - at_m) < 1e-9; };
}

double component(const Vec3d& v, int axis) {
  return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

double reaction(const Solver& solver, const Where& where, int axis) {
  const Vector all = solver.reactions();
  const auto& p = solver.problem().mesh.rest_positions;
  double sum = 0;
  for (std::size_t i = 0; i < p.size(); ++i)
    if (where(p[i])) sum += all[static_cast<Eigen::Index>(3 * i) + axis];
  return sum;
}

Vec3d mean_displacement(const Solver& solver, const Where& where) {
  const auto& p = solver.problem().mesh.rest_positions;
  Vec3d sum;
  double count = 0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    if (!where(p[i])) continue;
    const auto u = solver.displacements().segment<3>(static_cast<Eigen::Index>(3 * i));
    sum += Vec3d{u[0], u[1], u[2]};
    ++count;
  }
  return sum / count;
}

}  // namespace trocar::finite_elements::testing
