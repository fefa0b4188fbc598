#include "server/tissue/thread/chain_solver.h"

#include <algorithm>

namespace trocar::thread {
namespace {

// A gap of so many nodes between kept ones is not worth elimination of its own.
constexpr std::size_t kLeastMiddle = 4;

}  // namespace

// Filled gaps add to what touches: at worst three nodes to each two.
ChainSolver::ChainSolver(std::size_t most_far) : rest_(3 * most_far + 4) {
  far_.reserve(16 * most_far);
  kept_.reserve(rest_.most_nodes());
  middles_.reserve(rest_.most_nodes());
  rest_right_.reserve(rest_.most_nodes());
}

void ChainSolver::begin(std::size_t nodes) {
  nodes_ = nodes;
  diagonal_.assign(nodes, Block{});
  next_.assign(nodes, Block{});
  after_next_.assign(nodes, Block{});
  right_.assign(nodes, Column{});
  far_.clear();
}

void ChainSolver::add(std::size_t i, std::size_t j, const Block& block) {
  if (j == i)
    diagonal_[i] += block;
  else if (j == i + 1)
    next_[i] += block;
  else if (j == i + 2)
    after_next_[i] += block;
  else
    far_.push_back({i, j, block});
}

void ChainSolver::fill_gaps() {
  for (std::size_t i = 0; i + 2 < nodes_; ++i) {
    if (!is_kept(i)) continue;
    for (std::size_t gap = 2; gap <= kLeastMiddle && i + gap < nodes_; ++gap)
      if (is_kept(i + gap)) {
        for (std::size_t k = 1; k < gap; ++k) rest_of_[i + k] = 0;
        break;
      }
  }
}

// Without far couplings the two in the middle are kept, so that both ends are tails.
void ChainSolver::choose_kept() {
  rest_of_.assign(nodes_, kNotKept);
  kept_.clear();
  middles_.clear();
  for (const auto& far : far_) rest_of_[far.i] = rest_of_[far.j] = 0;
  if (far_.empty()) rest_of_[nodes_ / 2] = rest_of_[nodes_ / 2 - 1] = 0;
  fill_gaps();
  for (std::size_t i = 0; i < nodes_; ++i)
    if (is_kept(i)) {
      rest_of_[i] = kept_.size();
      kept_.push_back(i);
    }
  for (std::size_t k = 0; k + 1 < kept_.size(); ++k)
    if (kept_[k] + 1 < kept_[k + 1]) middles_.push_back({kept_[k] + 1, kept_[k + 1]});
}

// Tails couple to the one after the next by a multiple of the identity: bending alone.
void ChainSolver::eliminate_forward(std::size_t i) {
  const Block inv = inverse_[i] = inverse(diagonal_[i]);
  const Block factor = transposed(inv * next_[i]);
  const Column u = lane_of<0>(after_next_[i].columns[0]);
  diagonal_[i + 1] -= factor * next_[i];
  right_[i + 1] -= factor * right_[i];
  next_[i + 1].subtract(u, factor);
  diagonal_[i + 2].subtract(u * u, inv);
  right_[i + 2] -= u * (inv * right_[i]);
}

void ChainSolver::eliminate_backward(std::size_t i) {
  const Block inv = inverse_[i] = inverse(diagonal_[i]);
  const Block factor = next_[i - 1] * inv;
  const Column u = lane_of<0>(after_next_[i - 2].columns[0]);
  diagonal_[i - 1] -= factor * transposed(next_[i - 1]);
  right_[i - 1] -= factor * right_[i];
  next_[i - 2].subtract(u, transposed(factor));
  diagonal_[i - 2].subtract(u * u, inv);
  right_[i - 2] -= u * (inv * right_[i]);
}

void ChainSolver::eliminate_middle(const Middle& middle) {
  const std::size_t last = middle.begin - 1, last_but_one = middle.begin - 2;
  for (std::size_t i = middle.begin; i < middle.end; ++i)
    to_last_[i] = to_last_but_one_[i] = Block{};
  to_last_[middle.begin] = transposed(next_[last]);
  to_last_but_one_[middle.begin] = transposed(after_next_[last_but_one]);
  to_last_[middle.begin + 1] = transposed(after_next_[last]);
  for (std::size_t i = middle.begin; i < middle.end; ++i) eliminate_from_middle(middle, i);
}

void ChainSolver::eliminate_from_middle(const Middle& middle, std::size_t i) {
  const std::size_t last = middle.begin - 1, last_but_one = middle.begin - 2;
  const Block inv = inverse_[i] = inverse(diagonal_[i]);
  const Column z = inv * right_[i];
  const Block rows[2] = {transposed(next_[i]), transposed(after_next_[i])};
  const Block after = inv * after_next_[i];
  diagonal_[i + 1] -= rows[0] * (inv * next_[i]);
  next_[i + 1] -= rows[0] * after;
  diagonal_[i + 2] -= rows[1] * after;
  right_[i + 1] -= rows[0] * z;
  right_[i + 2] -= rows[1] * z;
  const Block p1 = inv * to_last_[i], p2 = inv * to_last_but_one_[i];
  const Block q1 = transposed(to_last_[i]), q2 = transposed(to_last_but_one_[i]);
  diagonal_[last] -= q1 * p1;
  diagonal_[last_but_one] -= q2 * p2;
  next_[last_but_one] -= q2 * p1;
  right_[last] -= q1 * z;
  right_[last_but_one] -= q2 * z;
  for (std::size_t k = 0; k < 2; ++k) {
    const std::size_t j = i + 1 + k;
    if (j < middle.end) {
      to_last_[j] -= rows[k] * p1;
      to_last_but_one_[j] -= rows[k] * p2;
    } else {
      rest_.add(rest_of_[j], rest_of_[last], rows[k] * p1, -1);
      rest_.add(rest_of_[j], rest_of_[last_but_one], rows[k] * p2, -1);
    }
  }
}

void ChainSolver::gather_rest() {
  rest_right_.resize(kept_.size());
  for (std::size_t a = 0; a < kept_.size(); ++a) {
    const std::size_t i = kept_[a];
    rest_right_[a] = right_[i];
    rest_.add(a, a, diagonal_[i], 1);
    if (i + 1 < nodes_ && is_kept(i + 1)) rest_.add(a, a + 1, next_[i], 1);
    if (i + 2 < nodes_ && is_kept(i + 2)) rest_.add(a, rest_of_[i + 2], after_next_[i], 1);
  }
  for (const auto& far : far_) rest_.add(rest_of_[far.i], rest_of_[far.j], far.block, 1);
}

Column ChainSolver::less_later(std::size_t i) const {
  return right_[i] - next_[i] * right_[i + 1] - after_next_[i] * right_[i + 2];
}

Column ChainSolver::less_earlier(std::size_t i) const {
  return right_[i] - transposed(next_[i - 1]) * right_[i - 1] -
         lane_of<0>(after_next_[i - 2].columns[0]) * right_[i - 2];
}

void ChainSolver::substitute() {
  for (std::size_t a = 0; a < kept_.size(); ++a) right_[kept_[a]] = rest_right_[a];
  for (const auto& middle : middles_)
    for (std::size_t i = middle.end; i-- > middle.begin;)
      right_[i] = inverse_[i] * (less_later(i) - to_last_[i] * right_[middle.begin - 1] -
                                 to_last_but_one_[i] * right_[middle.begin - 2]);
  const std::size_t first = kept_.front(), last = kept_.back();
  for (std::size_t k = 1; k <= first || last + k < nodes_; ++k) {
    if (k <= first) right_[first - k] = inverse_[first - k] * less_later(first - k);
    if (last + k < nodes_) right_[last + k] = inverse_[last + k] * less_earlier(last + k);
  }
}

void ChainSolver::solve() {
  choose_kept();
  inverse_.resize(nodes_);
  to_last_.resize(nodes_);
  to_last_but_one_.resize(nodes_);
  rest_.begin(kept_.size());
  const std::size_t first = kept_.front(), last = kept_.back();
  for (std::size_t k = 0; k < first || last + k + 1 < nodes_; ++k) {
    if (k < first) eliminate_forward(k);
    if (last + k + 1 < nodes_) eliminate_backward(nodes_ - 1 - k);
  }
  for (const auto& middle : middles_) eliminate_middle(middle);
  gather_rest();
  rest_.solve(rest_right_);
  substitute();
}

}  // namespace trocar::thread
