#pragma once

// Sparse Cholesky factors (CHOLMOD, supernodal) of a symmetric matrix of which the lower triangle
// is stored: the one place that calls CHOLMOD. Time O(n^2) for a solid of n nodes; memory
// O(n^(4/3)). One caller at a time; the work is done on the caller's thread, see the source.
// Errors: none thrown; factor() says whether the matrix was positive definite.

#include <Eigen/CholmodSupport>

#include "server/lab/finite_elements/problem.h"
#include "server/lab/finite_elements/sparse_pattern.h"

namespace trocar::finite_elements {

class SparseFactors {
 public:
  SparseFactors();

  // Once per pattern of entries, before factor().
  void analyze(const SparseMatrix& matrix);
  // Factors matrix + shift on its diagonal; its pattern is the analyzed one.
  bool factor(const SparseMatrix& matrix, double shift = 0);
  // After a factor() that was true; of a matrix each column.
  Vector solve(const Vector& right) const { return factors_.solve(right); }
  Eigen::MatrixXd solve(const Eigen::MatrixXd& right) const { return factors_.solve(right); }

 private:
  Eigen::CholmodSupernodalLLT<SparseMatrix, Eigen::Lower> factors_;
};

}  // namespace trocar::finite_elements
