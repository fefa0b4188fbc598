#pragma once

// The pattern says where elements' entries lie in the lower triangle of the tangent over the free
// degrees of freedom. It is built once per problem: O(elements log) time, and 4 bytes per entry of
// an element's matrix.

#include <Eigen/SparseCore>
#include <cstdint>
#include <span>
#include <vector>

#include "server/lab/finite_elements/problem.h"

namespace trocar::finite_elements {

using SparseMatrix = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;

class SparsePattern {
 public:
  explicit SparsePattern(const Problem& problem);

  std::size_t free_count() const { return free_count_; }
  // Number of a degree of freedom among the free ones; -1: held.
  const std::vector<int>& free_of_dof() const { return free_of_dof_; }
  // All zeros; the lower triangle by columns.
  const SparseMatrix& zeros() const { return zeros_; }
  // Per entry (row >= column, row by row) of an element's matrix: its place among the values, or -1
  // where a side is held.
  std::span<const int> places_of(std::size_t element) const {
    return {places_.data() + element * entries_, entries_};
  }

 private:
  void number_dofs(const Problem& problem);
  void make_columns(const Problem& problem);
  int place_of(int row, int column) const;
  void find_places(const Problem& problem);

  std::size_t free_count_ = 0, entries_ = 0;
  std::vector<int> free_of_dof_;
  SparseMatrix zeros_;
  std::vector<int> places_;
};

}  // namespace trocar::finite_elements
