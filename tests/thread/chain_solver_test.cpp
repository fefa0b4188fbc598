// Holds the direct solver of a chain against plain elimination of the whole matrix.

#include "server/tissue/thread/chain_solver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/random.h"

namespace trocar::thread {
namespace {

// The same system as one matrix.
class WholeMatrix {
 public:
  explicit WholeMatrix(std::size_t nodes)
      : size_(3 * nodes), values_(size_ * size_, 0.0), right(size_, 0.0) {}

  void add(std::size_t i, std::size_t j, const Block& block) {
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 3; ++c) {
        values_[(3 * i + r) * size_ + 3 * j + c] += block.at(r, c);
        if (i != j) values_[(3 * j + c) * size_ + 3 * i + r] += block.at(r, c);
      }
  }
  std::vector<double> solved() {
    for (std::size_t k = 0; k < size_; ++k)
      for (std::size_t i = k + 1; i < size_; ++i) {
        const double factor = values_[i * size_ + k] / values_[k * size_ + k];
        for (std::size_t j = k; j < size_; ++j)
          values_[i * size_ + j] -= factor * values_[k * size_ + j];
        right[i] -= factor * right[k];
      }
    for (std::size_t k = size_; k-- > 0;) {
      for (std::size_t j = k + 1; j < size_; ++j) right[k] -= values_[k * size_ + j] * right[j];
      right[k] /= values_[k * size_ + k];
    }
    return right;
  }

 private:
  std::size_t size_;
  std::vector<double> values_;

 public:
  std::vector<double> right;
};

// Springs between some nodes, each along a direction: w w^T (x) k.
class Springs {
 public:
  Springs(std::size_t nodes, std::uint64_t seed)
      : whole(nodes), solver(64), nodes_(nodes), random_(seed) {
    solver.begin(nodes);
    for (std::size_t i = 0; i < nodes; ++i) {
      add({i}, {1}, 1);
      const Column force = to_column(random_vector());
      solver.add_right(i, force);
      for (std::size_t r = 0; r < 3; ++r) whole.right[3 * i + r] = force[r];
    }
  }

  void add(const std::vector<std::size_t>& at, const std::vector<double>& weights, double k) {
    const Vec3d n = normalized(random_vector(), {0, 0, 1});
    add(at, weights, uniaxial(n, k, 0.3 * k));
  }
  void add(const std::vector<std::size_t>& at, const std::vector<double>& weights,
           const Block& block) {
    for (std::size_t a = 0; a < at.size(); ++a)
      for (std::size_t b = a; b < at.size(); ++b) {
        solver.add(at[a], at[b], block * (weights[a] * weights[b]));
        whole.add(at[a], at[b], block * (weights[a] * weights[b]));
      }
  }
  void add_chain() {
    for (std::size_t i = 0; i + 1 < nodes_; ++i) add({i, i + 1}, {1, -1}, 1000);
    for (std::size_t i = 0; i + 2 < nodes_; ++i)
      add({i, i + 1, i + 2}, {1, -2, 1}, uniaxial({0, 0, 1}, 10, 10));
  }
  void add_contact(std::size_t i, std::size_t j) {
    add({i, i + 1, j, j + 1}, {0.3, 0.7, -0.6, -0.4}, 5000);
  }
  double largest_error() {
    solver.solve();
    const auto expected = whole.solved();
    double error = 0, largest = 0;
    for (std::size_t i = 0; i < nodes_; ++i)
      for (std::size_t r = 0; r < 3; ++r) {
        const double value = r == 0   ? solver.solution(i).x
                             : r == 1 ? solver.solution(i).y
                                      : solver.solution(i).z;
        error = std::max(error, std::abs(value - expected[3 * i + r]));
        largest = std::max(largest, std::abs(value));
      }
    return error / largest;
  }

  WholeMatrix whole;
  ChainSolver solver;

 private:
  Vec3d random_vector() {
    return {random_.between(-1, 1), random_.between(-1, 1), random_.between(-1, 1)};
  }
  std::size_t nodes_;
  testing::Random random_;
};

TEST(ChainSolver, SolvesAChainWithoutContacts) {
  for (const std::size_t nodes : {4u, 5u, 6u, 7u, 30u, 31u}) {
    Springs springs(nodes, nodes);
    springs.add_chain();
    EXPECT_LT(springs.largest_error(), 1e-11) << nodes << " nodes";
  }
}

TEST(ChainSolver, SolvesWhatTouchesFarAlongTheChain) {
  const std::vector<std::vector<std::pair<std::size_t, std::size_t>>> contacts{
      {{0, 38}},
      {{5, 8}},
      {{5, 20}, {6, 19}, {11, 30}},
      {{0, 3}, {36, 1}},
      {{2, 36}, {12, 24}},
      {{4, 14}, {16, 26}, {28, 37}},
      {{1, 9}, {15, 24}},
      {{0, 5}, {33, 38}},
      {{3, 10}, {17, 31}, {24, 38}}};
  for (const auto& pairs : contacts) {
    Springs springs(40, 7);
    springs.add_chain();
    for (const auto& [i, j] : pairs) springs.add_contact(std::min(i, j), std::max(i, j));
    EXPECT_LT(springs.largest_error(), 1e-11) << pairs.front().first << ' ' << pairs.front().second;
  }
}

TEST(ChainSolver, KeepsOnlyWhatTouchesAndSmallGaps) {
  Springs springs(40, 3);
  springs.add_chain();
  springs.add_contact(5, 20);
  springs.add_contact(9, 30);
  EXPECT_LT(springs.largest_error(), 1e-11);
  EXPECT_EQ(springs.solver.kept_nodes(), 6u + 2u + 2u);  // 5 to 10, 20, 21, 30 and 31
}

}  // namespace
}  // namespace trocar::thread
