#pragma once

// The full model from which a reduced one is made: an organ of linear tets on the off-line solver,
// without inertia. At once (nothing relaxes) for snapshots and tangents, with relaxation for creep.
// One caller; deterministic.
//
// Elements are plain linear tets, also where the organ's live ones have their volume averaged:
// nearly incompressible, they are stiffer than those.

#include <memory>
#include <optional>
#include <span>

#include "server/lab/finite_elements/solver.h"
#include "server/papers/dogan/karhunen_loeve.h"
#include "server/papers/dogan/presses.h"

namespace trocar::dogan {

class FullModel {
 public:
  // Error: an organ without tets, of springs or tensor-mass, settled, or under gravity or tension.
  static Result<std::unique_ptr<FullModel>> create(const organ::Organ& organ, unsigned threads = 1);

  // 3 per node, N.
  Vector forces_of(const Press& press) const;
  // Displacements (3 per node, m) under shares of the forces, ascending, each from the one before.
  // As many as were found: a load that Newton's method does not manage ends the list.
  std::vector<Vector> displacements(const Vector& forces, std::span<const double> shares);
  // Solves K u = f with the first tangent of the tissue at rest, a column each. Factors are kept.
  Matrix linear_displacements(const Matrix& forces);
  // B^T K B with the tangent at these displacements, of modes that leave held nodes at rest;
  // nothing where an element is not admissible. N/m.
  std::optional<Matrix> reduced_tangent(const Vector& displacements, const Matrix& modes);
  // Under constant forces from time 0 on; times ascending from 0. As displacements().
  std::vector<Vector> creep(const Vector& forces, std::span<const double> times_s);

  const organ::Organ& organ() const { return organ_; }
  std::size_t dof_count() const { return elastic_->problem().dof_count(); }

 private:
  FullModel(const organ::Organ& organ, finite_elements::Problem problem, unsigned threads);
  // Fills tangent_ at the displacements. At rest unsplit laws have two tangents, one for each sign
  // of I1 - 3; what shears is on the upper side, so that one is taken.
  bool assemble(const Vector& displacements);

  const organ::Organ organ_;
  std::unique_ptr<finite_elements::Solver> elastic_;
  std::unique_ptr<finite_elements::Solver> relaxing_;  // made when it is needed
  finite_elements::Problem relaxing_problem_, rest_problem_;
  finite_elements::State elastic_rest_, relaxing_rest_;
  std::unique_ptr<finite_elements::Assembler> assembler_, rest_assembler_;
  finite_elements::SparseMatrix tangent_;
  std::unique_ptr<finite_elements::SparseFactors> rest_factors_;  // made when they are needed
  const unsigned threads_;
};

}  // namespace trocar::dogan
