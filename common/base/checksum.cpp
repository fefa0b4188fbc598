#include "common/base/checksum.h"

// Compiled here, for AVX2: the library's own code is for any processor and takes three times as
// long over a state. Digests are the same.
#define XXH_INLINE_ALL
#include <xxhash.h>
#include <zlib.h>

#include <algorithm>

#include "common/base/assert.h"

namespace trocar {

std::uint32_t crc32(BytesView bytes, std::uint32_t seed) {
  uLong crc = seed;
  while (!bytes.empty()) {
    const auto part = bytes.first(std::min<std::size_t>(bytes.size(), 1u << 30));
    crc = ::crc32(crc, part.data(), static_cast<uInt>(part.size()));
    bytes = bytes.subspan(part.size());
  }
  return static_cast<std::uint32_t>(crc);
}

struct StateHasher::State {
  XXH3_state_t* xxh = XXH3_createState();
  ~State() { XXH3_freeState(xxh); }
};

StateHasher::StateHasher() : state_(std::make_unique<State>()) {
  TROCAR_ASSERT(state_->xxh != nullptr);
  reset();
}
StateHasher::~StateHasher() = default;

void StateHasher::reset() {
  XXH3_64bits_reset(state_->xxh);
}
void StateHasher::update(BytesView bytes) {
  if (!bytes.empty()) XXH3_64bits_update(state_->xxh, bytes.data(), bytes.size());
}
std::uint64_t StateHasher::digest() const {
  return XXH3_64bits_digest(state_->xxh);
}

std::uint64_t xxh3_64(BytesView bytes) {
  return XXH3_64bits(bytes.data(), bytes.size());
}

}  // namespace trocar
