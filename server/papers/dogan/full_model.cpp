#include "server/papers/dogan/full_model.h"

#include <algorithm>

#include "server/organs/organ/any_material.h"

namespace trocar::dogan {
namespace {

using finite_elements::Problem;
using finite_elements::Solver;

// Snapshots are solved to this tolerance, far below any error of a reduced model.
constexpr double kTolerance = 1e-7;

Error wrong(const organ::Organ& organ, const std::string& what) {
  return {ErrorCode::BadFile, organ.name + ": " + what};
}

Status check(const organ::Organ& organ) {
  if (organ.mesh.tets.empty()) return wrong(organ, "has no tets, which a reduced model needs");
  if (organ::any_material(organ, [](const auto& m) { return !material::is_hyperelastic(m); }))
    return wrong(organ,
                 "is not of tets of a neo-Hookean or measured law everywhere, make or import it "
                 "with --material");
  if (organ::any_material(organ,
                          [](const auto& m) { return m.tension != 0 || m.fibre_tension != 0; }) ||
      length(organ.gravity_m_s2) > 0 || !organ.stress_free_positions_m.empty())
    return wrong(organ,
                 "is settled, or under gravity or tension; a reduced model is of an organ that is "
                 "free of stress at rest");
  if (organ.fixed_nodes.empty())
    return wrong(organ, "is held nowhere, so that no force has an equilibrium: see import --fix");
  return {};
}

// To first order, for I1 from 3 up: what Psi'' adds to the resistance against growth of volume, 4
// Psi''(3), is the bulk modulus's there.
material::HyperelasticMaterial near_rest(material::HyperelasticMaterial material) {
  if (material.split == material::VolumeSplit::Unsplit)
    material.bulk_modulus_pa += 4 * (material.energy == material::StrainEnergy::Exponential
                                         ? material.coefficients_pa[0] * material.exponent
                                         : 2 * material.coefficients_pa[1]);
  material.energy = material::StrainEnergy::ReducedPolynomial;
  material.exponent = 0;
  std::fill(material.coefficients_pa.begin() + 1, material.coefficients_pa.end(), 0.0);
  return material;
}

Problem problem_of(const organ::Organ& organ) {
  Problem problem;
  problem.mesh = finite_elements::make_elements(organ.mesh, organ.mesh.rest_positions,
                                                finite_elements::ElementOrder::Linear);
  problem.element_materials = organ::material_map(organ).tets;
  for (std::size_t i = 0; i <= organ.regions.size(); ++i) {
    const auto& material = organ::material_at(organ, static_cast<std::uint16_t>(i));
    problem.materials.push_back(finite_elements::law_of(material, organ.name));
    problem.densities_kg_m3.push_back(material.density_kg_m3);
  }
  for (const auto node : organ.fixed_nodes)
    for (std::uint32_t axis = 0; axis < 3; ++axis)
      problem.held_dofs.push_back(3 * node.value + axis);
  return problem;
}

}  // namespace

Result<std::unique_ptr<FullModel>> FullModel::create(const organ::Organ& organ, unsigned threads) {
  if (auto s = check(organ); !s) return s.error();
  auto problem = problem_of(organ);
  if (auto s = finite_elements::validate(problem); !s) return wrong(organ, s.error().message);
  return std::unique_ptr<FullModel>(new FullModel(organ, std::move(problem), threads));
}

FullModel::FullModel(const organ::Organ& organ, Problem problem, unsigned threads)
    : organ_(organ), relaxing_problem_(std::move(problem)), threads_(threads) {
  // The law that acts at once has no relaxation, and remembers nothing.
  Problem elastic = relaxing_problem_;
  for (auto& material : elastic.materials) material.relaxation.clear();
  elastic_ = std::make_unique<Solver>(
      std::move(elastic),
      finite_elements::SolverSettings{.threads = threads, .tolerance = kTolerance});
  elastic_rest_ = elastic_->state();
  rest_problem_ = elastic_->problem();
  for (auto& material : rest_problem_.materials) material = near_rest(material);
  assembler_ = std::make_unique<finite_elements::Assembler>(elastic_->problem(), threads);
  rest_assembler_ = std::make_unique<finite_elements::Assembler>(rest_problem_, threads);
  tangent_ = assembler_->pattern().zeros();
}

Vector FullModel::forces_of(const Press& press) const {
  Vector forces = Vector::Zero(static_cast<Eigen::Index>(dof_count()));
  for (const auto& [node, force] : node_forces(organ_, press))
    forces.segment<3>(3 * static_cast<Eigen::Index>(node.value)) +=
        Eigen::Vector3d(force.x, force.y, force.z);
  return forces;
}

std::vector<Vector> FullModel::displacements(const Vector& forces, std::span<const double> shares) {
  elastic_->restore(elastic_rest_);
  auto loads = finite_elements::no_loads(elastic_->problem());
  std::vector<Vector> found;
  for (const double share : shares) {
    loads.forces = share * forces;
    if (!elastic_->step(loads, {}).is_converged) break;
    found.push_back(elastic_->displacements());
  }
  return found;
}

bool FullModel::assemble(const Vector& displacements) {
  Vector forces = Vector::Zero(displacements.size()), product = forces;
  const Vector direction = forces;
  std::fill_n(tangent_.valuePtr(), tangent_.nonZeros(), 0.0);
  auto& assembler = displacements.isZero(0) ? *rest_assembler_ : *assembler_;
  return assembler.add_forces_and_tangent(displacements, 0, {}, direction, forces, product,
                                          tangent_);
}

Matrix FullModel::linear_displacements(const Matrix& forces) {
  if (rest_factors_ == nullptr) {
    rest_factors_ = std::make_unique<finite_elements::SparseFactors>();
    const bool is_admissible = assemble(Vector::Zero(forces.rows()));
    TROCAR_ASSERT(is_admissible);
    rest_factors_->analyze(tangent_);
    const bool is_positive_definite = rest_factors_->factor(tangent_);
    TROCAR_ASSERT(is_positive_definite);
  }
  const auto& numbers = assembler_->pattern().free_of_dof();
  Matrix free(static_cast<Eigen::Index>(assembler_->pattern().free_count()), forces.cols());
  for (std::size_t dof = 0; dof < numbers.size(); ++dof)
    if (numbers[dof] >= 0) free.row(numbers[dof]) = forces.row(static_cast<Eigen::Index>(dof));
  const Matrix solution = rest_factors_->solve(free);
  Matrix all = Matrix::Zero(forces.rows(), forces.cols());
  for (std::size_t dof = 0; dof < numbers.size(); ++dof)
    if (numbers[dof] >= 0) all.row(static_cast<Eigen::Index>(dof)) = solution.row(numbers[dof]);
  return all;
}

std::optional<Matrix> FullModel::reduced_tangent(const Vector& displacements, const Matrix& modes) {
  if (!assemble(displacements)) return std::nullopt;
  const auto& numbers = assembler_->pattern().free_of_dof();
  Matrix free(static_cast<Eigen::Index>(assembler_->pattern().free_count()), modes.cols());
  for (std::size_t dof = 0; dof < numbers.size(); ++dof)
    if (numbers[dof] >= 0) free.row(numbers[dof]) = modes.row(static_cast<Eigen::Index>(dof));
  const Matrix product = tangent_.selfadjointView<Eigen::Lower>() * free;
  const Matrix reduced = free.transpose() * product;
  return Matrix((reduced + reduced.transpose()) / 2);
}

std::vector<Vector> FullModel::creep(const Vector& forces, std::span<const double> times_s) {
  if (relaxing_ == nullptr) {
    relaxing_ = std::make_unique<Solver>(
        relaxing_problem_,
        finite_elements::SolverSettings{.threads = threads_, .tolerance = kTolerance});
    relaxing_rest_ = relaxing_->state();
  }
  relaxing_->restore(relaxing_rest_);
  auto loads = finite_elements::no_loads(relaxing_->problem());
  loads.forces = forces;
  std::vector<Vector> found;
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    const double dt_s = i == 0 ? 0 : times_s[i] - times_s[i - 1];
    if (!relaxing_->step(loads, {dt_s, false}).is_converged) break;
    found.push_back(relaxing_->displacements());
  }
  return found;
}

}  // namespace trocar::dogan
