#pragma once

// Compact adjacency ("compressed sparse row"): for each row a contiguous list of items.

#include <cstdint>
#include <span>
#include <vector>

#include "common/base/assert.h"

namespace trocar::mesh {

template <typename Row, typename Item>
struct Csr {
  std::vector<std::uint32_t> offsets;  // row_count + 1
  std::vector<Item> items;             // ascending within a row

  std::size_t row_count() const { return offsets.empty() ? 0 : offsets.size() - 1; }
  std::span<const Item> operator[](Row row) const {
    TROCAR_ASSERT_HOT(row.value < row_count());
    return {items.data() + offsets[row.value], offsets[row.value + 1] - offsets[row.value]};
  }
  bool operator==(const Csr&) const = default;
};

}  // namespace trocar::mesh
