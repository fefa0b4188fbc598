#include "server/lab/reduce/cubature.h"

#include <Eigen/Cholesky>
#include <algorithm>

namespace trocar::reduce {
namespace {

// The chosen columns and their normal equations, which grow and shrink with them.
class Chosen {
 public:
  Chosen(const Eigen::MatrixXf& a, const Vector& b, std::size_t capacity)
      : a_(a),
        b_(b),
        fields_(a.rows(), static_cast<Eigen::Index>(capacity)),
        normal_(fields_.cols(), fields_.cols()),
        right_(fields_.cols()) {}

  std::size_t size() const { return columns.size(); }
  void add(std::size_t column) {
    const auto at = static_cast<Eigen::Index>(size());
    fields_.col(at) = a_.col(static_cast<Eigen::Index>(column)).cast<double>();
    normal_.col(at).head(at + 1) = fields_.leftCols(at + 1).transpose() * fields_.col(at);
    normal_.row(at).head(at) = normal_.col(at).head(at).transpose();
    right_[at] = fields_.col(at).dot(b_);
    columns.push_back(column);
    weights.push_back(0);
  }
  void remove(std::size_t at) {
    const auto last = static_cast<Eigen::Index>(size()) - 1;
    for (auto i = static_cast<Eigen::Index>(at); i < last; ++i) {
      fields_.col(i) = fields_.col(i + 1);
      right_[i] = right_[i + 1];
      normal_.col(i).head(last + 1) = normal_.col(i + 1).head(last + 1).eval();
    }
    for (auto i = static_cast<Eigen::Index>(at); i < last; ++i)
      normal_.row(i).head(last) = normal_.row(i + 1).head(last).eval();
    columns.erase(columns.begin() + static_cast<std::ptrdiff_t>(at));
    weights.erase(weights.begin() + static_cast<std::ptrdiff_t>(at));
  }
  // Least squares without signs.
  Vector best() const {
    const auto count = static_cast<Eigen::Index>(size());
    Matrix normal = normal_.topLeftCorner(count, count);
    // Columns may be as good as equal.
    normal.diagonal() *= 1 + 1e-12;
    return normal.llt().solve(right_.head(count));
  }
  Vector residual() const {
    const auto count = static_cast<Eigen::Index>(size());
    return b_ - fields_.leftCols(count) * Eigen::Map<const Vector>(weights.data(), count);
  }

  std::vector<std::size_t> columns;
  std::vector<double> weights;

 private:
  const Eigen::MatrixXf& a_;
  const Vector& b_;
  Matrix fields_, normal_;
  Vector right_;
};

// Towards the best weights, as far as none turns negative; those that reach zero leave.
void descend(Chosen& chosen) {
  while (chosen.size() > 0) {
    const Vector best = chosen.best();
    double part = 1;
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      const double to = best[static_cast<Eigen::Index>(i)], from = chosen.weights[i];
      if (to <= 0) part = std::min(part, from / (from - to));
    }
    for (std::size_t i = 0; i < chosen.size(); ++i)
      chosen.weights[i] += part * (best[static_cast<Eigen::Index>(i)] - chosen.weights[i]);
    if (part == 1) return;
    for (std::size_t i = chosen.size(); i-- > 0;)
      if (chosen.weights[i] <= 1e-12 && best[static_cast<Eigen::Index>(i)] <= 0) chosen.remove(i);
  }
}

}  // namespace

Cubature find_cubature(const Eigen::MatrixXf& a, const Vector& b, double residual,
                       std::size_t max_columns) {
  // Columns that come in together, while there are many to go.
  constexpr std::size_t kTogether = 8;
  Cubature found;
  const double norm = b.norm();
  if (norm == 0) return found;
  max_columns = std::min(max_columns, static_cast<std::size_t>(a.cols()));
  Chosen chosen(a, b, max_columns + kTogether);
  Vector left = b;
  double before = norm;
  while (left.norm() > residual * norm && chosen.size() < max_columns) {
    const Eigen::VectorXf slopes = a.transpose() * left.cast<float>();
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < static_cast<std::size_t>(a.cols()); ++i)
      if (slopes[static_cast<Eigen::Index>(i)] > 0 &&
          std::ranges::find(chosen.columns, i) == chosen.columns.end())
        order.push_back(i);
    const std::size_t count = std::min({order.size(), kTogether, max_columns - chosen.size()});
    if (count == 0) break;
    std::ranges::partial_sort(order, order.begin() + static_cast<std::ptrdiff_t>(count),
                              std::greater<>(),
                              [&](std::size_t i) { return slopes[static_cast<Eigen::Index>(i)]; });
    for (std::size_t i = 0; i < count; ++i) chosen.add(order[i]);
    descend(chosen);
    left = chosen.residual();
    if (left.norm() > before * (1 - 1e-6)) break;
    before = left.norm();
  }
  std::vector<std::size_t> order(chosen.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::sort(order, {}, [&](std::size_t i) { return chosen.columns[i]; });
  for (const auto i : order) {
    found.columns.push_back(chosen.columns[i]);
    found.weights.push_back(chosen.weights[i]);
  }
  found.residual = left.norm() / norm;
  return found;
}

}  // namespace trocar::reduce
