#pragma once

// Unsigned numbers in as few bytes as they need: seven bits per byte, low ones first, the high bit
// set on all but the last (LEB128). Signed numbers become unsigned by zig-zag, sign in the low bit.

#include <optional>

#include "common/base/bytes.h"

namespace trocar {

inline void put_varint(Bytes& out, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) out.push_back(static_cast<std::uint8_t>(value | 0x80));
  out.push_back(static_cast<std::uint8_t>(value));
}

// Nothing for one that is cut short, larger than `most`, or longer than that takes.
inline std::optional<std::uint64_t> read_varint(ByteReader& reader, std::uint64_t most) {
  std::uint64_t value = 0;
  for (unsigned shift = 0; shift < 64 && most >> shift != 0; shift += 7) {
    const auto byte = reader.read<std::uint8_t>();
    value |= std::uint64_t{byte & 0x7fu} << shift;
    if (byte < 0x80) return reader.ok() && value <= most ? std::optional(value) : std::nullopt;
  }
  return std::nullopt;
}

inline std::uint32_t zigzag(std::int32_t v) {
  return static_cast<std::uint32_t>(v) << 1 ^ static_cast<std::uint32_t>(v >> 31);
}
inline std::int32_t unzigzag(std::uint64_t v) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(v >> 1) ^
                                   (0u - static_cast<std::uint32_t>(v & 1)));
}

}  // namespace trocar
