#pragma once

// A symmetric positive definite system that is dense: of the nodes of a thread that touch another
// place of it, once all nodes between were eliminated. L D L^T in place, three rows at a time.
// Cost: nodes^3. No allocation up to `most_nodes`.

#include <span>
#include <vector>

#include "server/tissue/thread/blocks.h"

namespace trocar::thread {

class DenseRest {
 public:
  explicit DenseRest(std::size_t most_nodes);

  std::size_t most_nodes() const { return most_nodes_; }
  void begin(std::size_t nodes);
  // Adds `scale` times the block, which stands in row a and column b, and its mirror image.
  void add(std::size_t a, std::size_t b, const Block& block, double scale);
  // Solves for these right-hand sides, in place.
  void solve(std::span<Column> right);

 private:
  double* row(std::size_t r) { return &values_[r * stride_]; }
  void factor_rows(std::size_t first);
  void eliminate_below(std::size_t first);

  std::size_t most_nodes_, size_ = 0, stride_ = 0;  // rows; numbers from row to row
  std::vector<double> values_;                      // upper triangle, by rows
  std::vector<double> inverse_diagonal_, solution_;
};

}  // namespace trocar::thread
