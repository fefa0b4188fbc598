#pragma once

// Solves for the moves of a chain of nodes directly. Stretch couples a node with the next, bending
// with the one after that: the matrix is a band. What touches far along the chain couples beyond
// it. Nodes with far couplings are kept, as a dense rest; all others are eliminated along the
// chain, block by block, from both ends at once: two chains of operations that do not wait for each
// other.
//
//   o--o--o--[ ]--[ ]--o--o--o--o--[ ]--[ ]--o--o--o     [ ] kept
//   tail ->  rest       middle       rest      <- tail
//
// Chains may be several: where one ends the blocks to the next are zero. Far couplings join
// segments at least three apart, and a kept node has a kept neighbour.
// Cost: nodes, and the cube of those that are kept. No allocation once warm.

#include <vector>

#include "server/tissue/thread/dense_rest.h"

namespace trocar::thread {

class ChainSolver {
 public:
  // most_far: nodes with far couplings, at most.
  explicit ChainSolver(std::size_t most_far);

  // nodes: at least 4.
  void begin(std::size_t nodes);
  // The matrix is symmetric: i <= j.
  void add(std::size_t i, std::size_t j, const Block& block);
  void add_diagonal(std::size_t i, const Block& block) { diagonal_[i] += block; }
  void add_diagonal(std::size_t i, double s) { diagonal_[i].add_identity(s); }
  void add_next(std::size_t i, const Block& block) { next_[i] += block; }
  void add_next(std::size_t i, double s) { next_[i].add_identity(s); }
  void add_after_next(std::size_t i, double s) { after_next_[i].add_identity(s); }
  void add_right(std::size_t i, Column force) { right_[i] += force; }

  // Replaces the right-hand side by the solution.
  void solve();
  Vec3d solution(std::size_t i) const { return to_vec3(right_[i]); }
  Vec3d right(std::size_t i) const { return to_vec3(right_[i]); }
  // Nodes of the dense rest, in the last solve.
  std::size_t kept_nodes() const { return kept_.size(); }

 private:
  struct Far {
    std::size_t i, j;
    Block block;
  };
  // Nodes [begin, end) between two kept ones.
  struct Middle {
    std::size_t begin, end;
  };
  static constexpr std::size_t kNotKept = static_cast<std::size_t>(-1);

  bool is_kept(std::size_t i) const { return rest_of_[i] != kNotKept; }
  void choose_kept();
  void fill_gaps();
  void eliminate_forward(std::size_t i);
  void eliminate_backward(std::size_t i);
  void eliminate_middle(const Middle& middle);
  void eliminate_from_middle(const Middle& middle, std::size_t i);
  void gather_rest();
  Column less_later(std::size_t i) const;
  Column less_earlier(std::size_t i) const;
  void substitute();

  std::size_t nodes_ = 0;
  std::vector<Block> diagonal_, next_, after_next_;  // (i, i), (i, i + 1), (i, i + 2)
  std::vector<Column> right_;
  std::vector<Far> far_;
  // Workspace: inverses; a middle's couplings to the kept node before it and the one before that.
  std::vector<Block> inverse_, to_last_, to_last_but_one_;
  std::vector<std::size_t> rest_of_, kept_;
  std::vector<Middle> middles_;
  DenseRest rest_;
  std::vector<Column> rest_right_;
};

}  // namespace trocar::thread
