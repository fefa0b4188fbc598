#include "server/lab/finite_elements/sparse_pattern.h"

#include <algorithm>
#include <array>

#include "common/base/assert.h"

namespace trocar::finite_elements {

SparsePattern::SparsePattern(const Problem& problem) {
  const std::size_t dofs = 3 * problem.mesh.nodes_per_element();
  entries_ = dofs * (dofs + 1) / 2;
  number_dofs(problem);
  make_columns(problem);
  find_places(problem);
}

void SparsePattern::number_dofs(const Problem& problem) {
  free_of_dof_.assign(problem.dof_count(), 0);
  for (const auto dof : problem.held_dofs) free_of_dof_[dof] = -1;
  int next = 0;
  for (auto& number : free_of_dof_)
    if (number == 0) number = next++;
  free_count_ = static_cast<std::size_t>(next);
}

void SparsePattern::make_columns(const Problem& problem) {
  // Neighbours of higher number, and the node itself, once each.
  const auto& mesh = problem.mesh;
  std::vector<std::vector<std::uint32_t>> higher(mesh.node_count());
  for (std::size_t e = 0; e < mesh.element_count(); ++e)
    for (const auto a : mesh.nodes_of(e))
      for (const auto b : mesh.nodes_of(e))
        if (b >= a) higher[a].push_back(b);
  std::vector<int> starts{0}, rows;
  for (std::uint32_t a = 0; a < mesh.node_count(); ++a) {
    auto& nodes = higher[a];
    std::sort(nodes.begin(), nodes.end());
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      const int column = free_of_dof_[3 * a + axis];
      if (column < 0) continue;
      for (const auto b : nodes)
        for (std::uint32_t other = 0; other < 3; ++other)
          if (const int row = free_of_dof_[3 * b + other]; row >= column) rows.push_back(row);
      starts.push_back(static_cast<int>(rows.size()));
    }
    std::vector<std::uint32_t>().swap(nodes);
  }
  const int size = static_cast<int>(free_count_);
  const std::vector<double> values(rows.size(), 0.0);
  zeros_ = Eigen::Map<const SparseMatrix>(size, size, static_cast<int>(rows.size()), starts.data(),
                                          rows.data(), values.data());
}

int SparsePattern::place_of(int row, int column) const {
  const int* begin = zeros_.innerIndexPtr() + zeros_.outerIndexPtr()[column];
  const int* end = zeros_.innerIndexPtr() + zeros_.outerIndexPtr()[column + 1];
  const int* found = std::lower_bound(begin, end, row);
  TROCAR_ASSERT(found != end && *found == row);
  return static_cast<int>(found - zeros_.innerIndexPtr());
}

void SparsePattern::find_places(const Problem& problem) {
  const auto& mesh = problem.mesh;
  places_.reserve(mesh.element_count() * entries_);
  std::array<int, 3 * kMaxElementNodes> numbers{};
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    const auto nodes = mesh.nodes_of(e);
    for (std::size_t a = 0; a < nodes.size(); ++a)
      for (std::size_t axis = 0; axis < 3; ++axis)
        numbers[3 * a + axis] = free_of_dof_[3 * nodes[a] + axis];
    for (std::size_t row = 0; row < 3 * nodes.size(); ++row)
      for (std::size_t column = 0; column <= row; ++column) {
        const auto [low, high] = std::minmax(numbers[row], numbers[column]);
        places_.push_back(low < 0 ? -1 : place_of(high, low));
      }
  }
}

}  // namespace trocar::finite_elements
