#pragma once

// Hashes arrays one after another such that their borders count, too.

#include <cstdint>
#include <span>
#include <vector>

#include "common/base/checksum.h"

namespace trocar {

// Adds the number of values, then the values, which have no padding.
template <typename T>
void hash_array(StateHasher& hasher, const std::vector<T>& values) {
  const std::uint64_t count = values.size();
  hasher.update(bytes_of(std::span(&count, 1)));
  hasher.update(bytes_of(values));
}

}  // namespace trocar
