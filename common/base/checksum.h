#pragma once

// CRC-32 (zlib's polynomial) guards bytes on the wire and in files. XXH3-64 is the tick hash over
// state arrays. Neither is ever taken over a Protobuf encoding, which is not canonical.

#include <cstdint>
#include <memory>

#include "common/base/bytes.h"

namespace trocar {

// CRC of `bytes`, continuing from `seed` (the CRC of what came before; 0 at the start).
std::uint32_t crc32(BytesView bytes, std::uint32_t seed = 0);

// Streaming XXH3-64: the digest of several updates equals that of the concatenated bytes.
class StateHasher {
 public:
  StateHasher();
  ~StateHasher();
  StateHasher(const StateHasher&) = delete;
  StateHasher& operator=(const StateHasher&) = delete;

  void reset();
  void update(BytesView bytes);
  std::uint64_t digest() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

std::uint64_t xxh3_64(BytesView bytes);

}  // namespace trocar
