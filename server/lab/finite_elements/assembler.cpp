#include "server/lab/finite_elements/assembler.h"

#include <algorithm>

namespace trocar::finite_elements {
namespace {

// Elements that are computed before they are added up: 4 MB of entries of quadratic ones.
constexpr std::size_t kBlockElements = 1024;

// Rows of dE by the displacement of a node whose shape gradient is d.
Eigen::Matrix<double, 6, 3> strain_rows(const Matrix3& f, const Eigen::RowVector3d& d) {
  Eigen::Matrix<double, 6, 3> b;
  for (int i = 0; i < 3; ++i) {
    b(0, i) = f(i, 0) * d(0);
    b(1, i) = f(i, 1) * d(1);
    b(2, i) = f(i, 2) * d(2);
    b(3, i) = f(i, 0) * d(1) + f(i, 1) * d(0);
    b(4, i) = f(i, 1) * d(2) + f(i, 2) * d(1);
    b(5, i) = f(i, 2) * d(0) + f(i, 0) * d(2);
  }
  return b;
}

template <int Nodes>
Eigen::Matrix<double, 3, Nodes> gathered(const Vector& values,
                                         std::span<const std::uint32_t> nodes) {
  Eigen::Matrix<double, 3, Nodes> m;
  for (int a = 0; a < Nodes; ++a)
    m.col(a) = values.segment<3>(3 * static_cast<Eigen::Index>(nodes[static_cast<std::size_t>(a)]));
  return m;
}

template <int Nodes>
void add_mass(Eigen::Matrix<double, 3 * Nodes, 3 * Nodes>& k, ElementOrder order, double mass) {
  for (int a = 0; a < Nodes; ++a)
    for (int b = 0; b < Nodes; ++b)
      k.template block<3, 3>(3 * a, 3 * b).diagonal().array() +=
          mass * mass_share(order, static_cast<std::size_t>(a), static_cast<std::size_t>(b));
}

}  // namespace

std::size_t history_stride(const Problem& problem) {
  std::size_t stride = 0;
  for (const auto& material : problem.materials)
    stride = std::max(stride, history_size(material.relaxation.size()));
  return stride;
}

std::size_t history_length(const Problem& problem) {
  return history_stride(problem) * problem.mesh.points_per_element() * problem.mesh.element_count();
}

Assembler::Assembler(const Problem& problem, unsigned threads)
    : problem_(problem),
      pattern_(problem),
      workers_(threads),
      stride_(history_stride(problem)),
      history_(history_length(problem), 0.0) {
  const auto& mesh = problem.mesh;
  const std::size_t dofs = 3 * mesh.nodes_per_element();
  block_.forces.resize(kBlockElements * dofs);
  block_.products.resize(kBlockElements * dofs);
  block_.entries.resize(kBlockElements * (dofs * (dofs + 1) / 2));
  block_.is_admissible.resize(kBlockElements);
}

std::vector<RelaxationStep> Assembler::steps_of(double dt_s) const {
  std::vector<RelaxationStep> steps;
  for (const auto& material : problem_.materials) steps.emplace_back(material, dt_s);
  return steps;
}

template <int Nodes, int Points>
bool Assembler::compute(const Job& job, std::size_t element, std::size_t slot) {
  constexpr int kDofs = 3 * Nodes;
  const auto& mesh = problem_.mesh;
  const auto nodes = mesh.nodes_of(element);
  const auto& material = problem_.material_of(element);
  const auto& step = job.steps[problem_.element_materials[element]];
  const auto u = gathered<Nodes>(job.u, nodes);
  const double weight = mesh.volumes[element] / Points;
  Eigen::Matrix<double, kDofs, 1> force = Eigen::Matrix<double, kDofs, 1>::Zero();
  Eigen::Matrix<double, kDofs, kDofs> k = Eigen::Matrix<double, kDofs, kDofs>::Zero();
  const auto points = quadrature_points(mesh.order);
  for (std::size_t q = 0; q < Points; ++q) {
    const auto d = shape_gradients<Nodes>(mesh.gradients[element], points[q]);
    const Matrix3 f = Matrix3::Identity() + u * d;
    const auto stress = stress_of(material, f);
    if (!stress) return false;
    const Vector6 total = relaxed_stress(step, history_of(element, q), stress->relaxing.stress) +
                          stress->volumetric.stress;
    Eigen::Matrix<double, 6, kDofs> b;
    for (int a = 0; a < Nodes; ++a) b.template middleCols<3>(3 * a) = strain_rows(f, d.row(a));
    force.noalias() += weight * b.transpose() * total;
    if (job.direction == nullptr) continue;
    const Matrix6 tangent =
        step.tangent_share * stress->relaxing.tangent + stress->volumetric.tangent;
    const Eigen::Matrix<double, 6, kDofs> tb = tangent * b;
    k.noalias() += weight * b.transpose() * tb;
    const Eigen::Matrix<double, Nodes, Nodes> geometric =
        weight * d * to_matrix(total) * d.transpose();
    for (int a = 0; a < Nodes; ++a)
      for (int c = 0; c < Nodes; ++c)
        k.template block<3, 3>(3 * a, 3 * c).diagonal().array() += geometric(a, c);
  }
  Eigen::Map<Eigen::Matrix<double, kDofs, 1>>(&block_.forces[slot * kDofs]) = force;
  if (job.direction == nullptr) return true;
  k *= job.factors.stiffness;
  if (job.factors.mass != 0)
    add_mass<Nodes>(k, mesh.order,
                    job.factors.mass * mesh.volumes[element] *
                        problem_.densities_kg_m3[problem_.element_materials[element]]);
  const auto direction = gathered<Nodes>(*job.direction, nodes);
  Eigen::Map<Eigen::Matrix<double, kDofs, 1>>(&block_.products[slot * kDofs]).noalias() =
      k * Eigen::Map<const Eigen::Matrix<double, kDofs, 1>>(direction.data());
  double* entry = &block_.entries[slot * (kDofs * (kDofs + 1) / 2)];
  for (int row = 0; row < kDofs; ++row)
    for (int column = 0; column <= row; ++column) *entry++ = k(row, column);
  return true;
}

bool Assembler::compute_any(const Job& job, std::size_t element, std::size_t slot) {
  return problem_.mesh.order == ElementOrder::Linear ? compute<4, 1>(job, element, slot)
                                                     : compute<10, 4>(job, element, slot);
}

void Assembler::scatter(std::size_t element, std::size_t slot, Vector& forces, Vector* product,
                        SparseMatrix* tangent) const {
  const auto nodes = problem_.mesh.nodes_of(element);
  const std::size_t dofs = 3 * nodes.size();
  for (std::size_t i = 0; i < dofs; ++i) {
    const auto dof = static_cast<Eigen::Index>(3 * nodes[i / 3] + i % 3);
    forces[dof] += block_.forces[slot * dofs + i];
    if (product != nullptr) (*product)[dof] += block_.products[slot * dofs + i];
  }
  if (tangent == nullptr) return;
  const auto places = pattern_.places_of(element);
  const double* entries = &block_.entries[slot * places.size()];
  double* values = tangent->valuePtr();
  for (std::size_t i = 0; i < places.size(); ++i)
    if (places[i] >= 0) values[places[i]] += entries[i];
}

bool Assembler::run(const Job& job, Vector& forces, Vector* product, SparseMatrix* tangent) {
  const std::size_t count = problem_.mesh.element_count();
  for (std::size_t begin = 0; begin < count; begin += kBlockElements) {
    const std::size_t size = std::min(kBlockElements, count - begin);
    workers_.for_each(size, 1, [&](std::size_t i, unsigned) {
      block_.is_admissible[i] = compute_any(job, begin + i, i) ? 1 : 0;
    });
    for (std::size_t i = 0; i < size; ++i) {
      if (block_.is_admissible[i] == 0) return false;
      scatter(begin + i, i, forces, product, tangent);
    }
  }
  return true;
}

bool Assembler::add_forces(const Vector& u, double dt_s, Vector& forces) {
  return run({u, nullptr, {}, steps_of(dt_s)}, forces, nullptr, nullptr);
}

bool Assembler::add_forces_and_tangent(const Vector& u, double dt_s, const TangentFactors& factors,
                                       const Vector& direction, Vector& forces, Vector& product,
                                       SparseMatrix& tangent) {
  return run({u, &direction, factors, steps_of(dt_s)}, forces, &product, &tangent);
}

Vector Assembler::mass_times(const Vector& values) const {
  Vector product = Vector::Zero(values.size());
  const auto& mesh = problem_.mesh;
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    const double mass = mesh.volumes[e] * problem_.densities_kg_m3[problem_.element_materials[e]];
    const auto nodes = mesh.nodes_of(e);
    for (std::size_t a = 0; a < nodes.size(); ++a)
      for (std::size_t b = 0; b < nodes.size(); ++b)
        product.segment<3>(3 * static_cast<Eigen::Index>(nodes[a])) +=
            mass * mass_share(mesh.order, a, b) *
            values.segment<3>(3 * static_cast<Eigen::Index>(nodes[b]));
  }
  return product;
}

void Assembler::advance(const Vector& u, double dt_s) {
  if (stride_ == 0) return;
  const auto& mesh = problem_.mesh;
  const auto steps = steps_of(dt_s);
  const auto points = quadrature_points(mesh.order);
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    const auto& material = problem_.material_of(e);
    for (std::size_t q = 0; q < points.size(); ++q) {
      Matrix3 f = Matrix3::Identity();
      if (mesh.order == ElementOrder::Linear)
        f += gathered<4>(u, mesh.nodes_of(e)) * shape_gradients<4>(mesh.gradients[e], points[q]);
      else
        f += gathered<10>(u, mesh.nodes_of(e)) * shape_gradients<10>(mesh.gradients[e], points[q]);
      const auto stress = stress_of(material, f);
      TROCAR_ASSERT(stress.has_value());
      advance_history(steps[problem_.element_materials[e]], history_of(e, q),
                      stress->relaxing.stress);
    }
  }
}

}  // namespace trocar::finite_elements
