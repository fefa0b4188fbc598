// Some libraries do not exist for the module. This stands in for zlib, and for the end of a program
// whose own assumption was wrong.

#include <array>
#include <cstring>

#include "common/base/assert.h"
#include "common/base/checksum.h"

#ifdef __wasm__
namespace trocar {
namespace {

// CRC-32 of zlib, eight bytes at a time by tables.
constexpr auto kTables = [] {
  std::array<std::array<std::uint32_t, 256>, 8> tables{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t crc = i;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1) ? 0xedb88320u ^ (crc >> 1) : crc >> 1;
    tables[0][i] = crc;
  }
  for (std::uint32_t i = 0; i < 256; ++i)
    for (std::size_t slice = 1; slice < 8; ++slice)
      tables[slice][i] = tables[0][tables[slice - 1][i] & 255] ^ (tables[slice - 1][i] >> 8);
  return tables;
}();

}  // namespace

std::uint32_t crc32(BytesView bytes, std::uint32_t seed) {
  std::uint32_t crc = ~seed;
  std::size_t at = 0;
  for (; at + 8 <= bytes.size(); at += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + at, sizeof word);
    word ^= crc;
    crc = 0;
    for (std::size_t slice = 0; slice < 8; ++slice)
      crc ^= kTables[7 - slice][word >> (8 * slice) & 255];
  }
  for (; at < bytes.size(); ++at) crc = kTables[0][(crc ^ bytes[at]) & 255] ^ (crc >> 8);
  return ~crc;
}

void assert_failed(const char*, const char*, int) {
  __builtin_trap();
}

}  // namespace trocar
#endif
