#pragma once

// A sparse square matrix of 3 x 3 blocks over local nodes, rows of ascending columns.

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace trocar::reduction {

class BlockMatrix {
 public:
  using Block = std::array<float, 9>;  // row by row
  using Pair = std::pair<std::uint32_t, std::uint32_t>;

  BlockMatrix() = default;
  // Pairs in any order and number, both ways round.
  BlockMatrix(std::size_t node_count, std::vector<Pair> pairs);

  std::size_t node_count() const { return begins_.empty() ? 0 : begins_.size() - 1; }
  std::span<const std::uint32_t> columns(std::size_t row) const {
    return {columns_.data() + begins_[row], begins_[row + 1] - begins_[row]};
  }
  std::span<const Block> blocks(std::size_t row) const {
    return {blocks_.data() + begins_[row], begins_[row + 1] - begins_[row]};
  }
  // A pair that was named.
  Block& at(std::uint32_t row, std::uint32_t column);
  void clear() { blocks_.assign(blocks_.size(), Block{}); }

 private:
  std::vector<std::uint32_t> begins_, columns_;
  std::vector<Block> blocks_;
};

}  // namespace trocar::reduction
