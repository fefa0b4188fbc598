#pragma once

// Bytes whose order can be seen, so that a test notices lost, doubled and exchanged ones.

#include "common/base/bytes.h"

namespace trocar::impair {

inline Bytes pattern(std::size_t size) {
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(i * 31 + i / 251);
  return bytes;
}

}  // namespace trocar::impair
