#include "common/base/checksum.h"

#include <gtest/gtest.h>

#include <random>

namespace trocar {
namespace {

// The check values that the CRC catalogue and xxHash's own test programme give.
TEST(Checksum, KnownValues) {
  EXPECT_EQ(crc32(bytes_of(std::string_view("123456789"))), 0xcbf43926u);
  EXPECT_EQ(crc32({}), 0u);
  EXPECT_EQ(xxh3_64({}), 0x2d06800538d394c2u);
}

TEST(Checksum, StreamingEqualsWholeForEverySplit) {
  std::mt19937 random(1);
  Bytes bytes(700);
  for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
  const BytesView whole(bytes);
  for (std::size_t split = 0; split <= whole.size(); split += 7) {
    EXPECT_EQ(crc32(whole.subspan(split), crc32(whole.first(split))), crc32(whole));
    StateHasher hasher;
    hasher.update(whole.first(split));
    hasher.update(whole.subspan(split));
    EXPECT_EQ(hasher.digest(), xxh3_64(whole));
  }
}

TEST(Checksum, EverySingleBitChangesBoth) {
  Bytes bytes(64, 0x5a);
  const auto crc = crc32(bytes);
  const auto hash = xxh3_64(bytes);
  for (std::size_t bit = 0; bit < bytes.size() * 8; ++bit) {
    const auto mask = static_cast<std::uint8_t>(1u << (bit % 8));
    bytes[bit / 8] ^= mask;
    EXPECT_NE(crc32(bytes), crc) << bit;
    EXPECT_NE(xxh3_64(bytes), hash) << bit;
    bytes[bit / 8] ^= mask;
  }
}

TEST(Checksum, ResetForgetsWhatCameBefore) {
  StateHasher hasher;
  hasher.update(bytes_of(std::string_view("before")));
  hasher.reset();
  EXPECT_EQ(hasher.digest(), xxh3_64({}));
}

}  // namespace
}  // namespace trocar
