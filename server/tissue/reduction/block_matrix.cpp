#include "server/tissue/reduction/block_matrix.h"

#include <algorithm>

#include "common/base/assert.h"

namespace trocar::reduction {

BlockMatrix::BlockMatrix(std::size_t node_count, std::vector<Pair> pairs) {
  std::ranges::sort(pairs);
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  begins_.assign(node_count + 1, 0);
  for (const auto& [row, column] : pairs) {
    ++begins_[row + 1];
    columns_.push_back(column);
  }
  for (std::size_t i = 0; i < node_count; ++i) begins_[i + 1] += begins_[i];
  blocks_.resize(columns_.size());
}

BlockMatrix::Block& BlockMatrix::at(std::uint32_t row, std::uint32_t column) {
  const auto of_row = columns(row);
  const auto found = std::ranges::lower_bound(of_row, column);
  TROCAR_ASSERT(found != of_row.end() && *found == column);
  return blocks_[begins_[row] + static_cast<std::size_t>(found - of_row.begin())];
}

}  // namespace trocar::reduction
