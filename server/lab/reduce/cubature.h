#pragma once

// Non-negative least squares for cubature: few columns with positive weights whose sum is near b
// (Lawson & Hanson 1974; as in An, Kim & James 2008, columns are taken greedily).

#include <vector>

#include "server/lab/reduce/karhunen_loeve.h"

namespace trocar::reduce {

struct Cubature {
  std::vector<std::size_t> columns;  // ascending
  std::vector<double> weights;       // positive
  double residual = 0;               // |A w - b| / |b|
};
// Ends at the residual or at `max_columns`. b = 0: no columns.
Cubature find_cubature(const Eigen::MatrixXf& a, const Vector& b, double residual,
                       std::size_t max_columns);

}  // namespace trocar::reduce
