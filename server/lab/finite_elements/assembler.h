#pragma once

// Internal forces and the consistent tangent of all elements. Elements are computed on several
// threads in blocks and added up in their order, so that results do not depend on the number of
// threads. Memory beside the pattern: 6 (terms + 1) numbers per quadrature point for the history.

#include <vector>

#include "common/base/workers.h"
#include "server/lab/finite_elements/relaxation.h"
#include "server/lab/finite_elements/sparse_pattern.h"

namespace trocar::finite_elements {

// The tangent is stiffness x tangent of the internal forces + mass x mass matrix.
struct TangentFactors {
  double stiffness = 1, mass = 0;
};

// Numbers that relaxation remembers, per quadrature point and of all elements.
std::size_t history_stride(const Problem& problem);
std::size_t history_length(const Problem& problem);

class Assembler {
 public:
  // The problem must stay where it is.
  Assembler(const Problem& problem, unsigned threads);

  const SparsePattern& pattern() const { return pattern_; }

  // Forces of the tissue's resistance (3 per node, N; they balance loads) at displacements u at the
  // end of a step of dt_s. False, and nothing to be used, where an element is not admissible.
  bool add_forces(const Vector& u, double dt_s, Vector& forces);
  // Also the tangent over the free degrees of freedom, and its product with `direction` (3 per
  // node, held ones too) for prescribed motion.
  bool add_forces_and_tangent(const Vector& u, double dt_s, const TangentFactors& factors,
                              const Vector& direction, Vector& forces, Vector& product,
                              SparseMatrix& tangent);
  // Mass matrix times a vector, 3 per node.
  Vector mass_times(const Vector& values) const;
  // The step to u is done.
  void advance(const Vector& u, double dt_s);

  const std::vector<double>& history() const { return history_; }
  void set_history(std::vector<double> history) { history_ = std::move(history); }

 private:
  // The results of one block of elements have their entries row by row, as the pattern wants them.
  struct Block {
    std::vector<double> forces, products, entries;
    std::vector<std::uint8_t> is_admissible;
  };
  struct Job {
    const Vector& u;
    const Vector* direction = nullptr;  // null: forces alone
    TangentFactors factors;
    std::vector<RelaxationStep> steps;  // per material
  };
  template <int Nodes, int Points>
  bool compute(const Job& job, std::size_t element, std::size_t slot);
  bool compute_any(const Job& job, std::size_t element, std::size_t slot);
  bool run(const Job& job, Vector& forces, Vector* product, SparseMatrix* tangent);
  void scatter(std::size_t element, std::size_t slot, Vector& forces, Vector* product,
               SparseMatrix* tangent) const;
  std::vector<RelaxationStep> steps_of(double dt_s) const;
  double* history_of(std::size_t element, std::size_t point) {
    return history_.data() + (element * problem_.mesh.points_per_element() + point) * stride_;
  }

  const Problem& problem_;
  SparsePattern pattern_;
  Workers workers_;
  std::size_t stride_ = 0;  // numbers of history per point: that of the material with most terms
  std::vector<double> history_;
  Block block_;
};

}  // namespace trocar::finite_elements
