// Levels of blood travel whole, and nothing that comes from outside is believed.

#include "common/wire/blood_codec.h"

#include <gtest/gtest.h>

#include "common/wire/surface_slices.h"
#include "tests/wire/surface_states.h"

namespace trocar::wire {
namespace {

using testing::Random;

// Returns a number below n.
std::size_t below(Random& random, std::size_t n) {
  return random.below(static_cast<std::uint32_t>(n));
}

BloodLevels random_levels(Random& random, std::size_t vertices, std::size_t one_in) {
  BloodLevels levels(vertices);
  for (auto& level : levels)
    if (below(random, one_in) == 0) level = static_cast<std::uint8_t>(random.below(256));
  return levels;
}

TEST(BloodCodec, WhatIsEncodedComesOut) {
  Random random(1);
  for (int round = 0; round < 300; ++round) {
    const auto before = random_levels(random, 1 + below(random, 3000), 1 + below(random, 50));
    auto after = random_levels(random, before.size() + below(random, 200), 1 + below(random, 50));
    Bytes payload;
    encode_blood(before, after, payload);
    auto levels = before;
    levels.resize(after.size(), 0);
    ASSERT_TRUE(decode_blood(payload, levels).ok());
    ASSERT_EQ(levels, after);
    Bytes key;
    encode_blood({}, after, key);
    BloodLevels from_nothing(after.size());
    ASSERT_TRUE(decode_blood(key, from_nothing).ok());
    ASSERT_EQ(from_nothing, after);
  }
}

TEST(BloodCodec, NoChangeIsNoByteAndOneIsTen) {
  const BloodLevels dry(1000);
  Bytes payload;
  encode_blood(dry, dry, payload);
  EXPECT_TRUE(payload.empty());
  auto drop = dry;
  drop[700] = 9;
  encode_blood(dry, drop, payload);
  // It is block 10, the mask of slot 60, the level.
  EXPECT_EQ(payload, (Bytes{10, 0, 0, 0, 0, 0, 0, 0, 0x10, 9}));
}

TEST(BloodCodec, WhatIsCutShortOrBeyondTheSurfaceIsRefusedAndChangesNothing) {
  Random random(2);
  const auto after = random_levels(random, 150, 3);
  Bytes payload;
  encode_blood({}, after, payload);
  for (std::size_t size = 1; size < payload.size(); ++size) {
    BloodLevels levels(150, 7);
    const auto read = decode_blood(BytesView(payload).first(size), levels);
    if (read.ok()) continue;  // whole blocks
    EXPECT_EQ(levels, BloodLevels(150, 7)) << size;
  }
  BloodLevels levels(150, 7);
  const auto is_taken = [&](const Bytes& bytes) { return decode_blood(bytes, levels).ok(); };
  EXPECT_FALSE(is_taken({3, 1, 0, 0, 0, 0, 0, 0, 0, 5})) << "a block beyond the surface";
  EXPECT_FALSE(is_taken({2, 0, 0, 0x80, 0, 0, 0, 0, 0, 5})) << "a slot beyond the surface";
  EXPECT_FALSE(is_taken({0, 0, 0, 0, 0, 0, 0, 0, 0})) << "an empty mask";
  EXPECT_FALSE(is_taken({0, 1, 0, 0, 0, 0, 0, 0, 0, 5, 0})) << "trailing bytes";
  EXPECT_EQ(levels, BloodLevels(150, 7));
}

TEST(BloodCodec, RandomBytesNeverReachBeyondTheSurface) {
  Random random(3);
  for (int round = 0; round < 20'000; ++round) {
    Bytes bytes(random.below(60));
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random.below(256));
    BloodLevels levels(1 + random.below(300));
    static_cast<void>(decode_blood(bytes, levels));
  }
}

TEST(BloodCodec, SlicesBringItWithTheirVertices) {
  constexpr std::size_t kMostBytes = 1000;
  Random random(4);
  for (int round = 0; round < 100; ++round) {
    const auto vertices = 1 + below(random, 4000);
    const auto baseline = testing::random_surface(random, vertices, 400);
    const auto current = testing::moved(random, baseline, 1 + random.below(40), 60);
    // The last vertices are new: the baseline's blood lacks them.
    const auto before = random_levels(random, 1 + below(random, vertices), 20);
    const auto after = random_levels(random, vertices, 1 + below(random, 30));
    auto slices =
        encode_slices(baseline, current, kMostBytes, {.baseline = before, .current = after});
    ASSERT_FALSE(slices.empty());
    auto surface = baseline;
    auto levels = before;
    levels.resize(vertices, 0);
    while (!slices.empty()) {
      const auto next = below(random, slices.size());
      ASSERT_LE(slices[next].payload.size() + slices[next].blood.size(), kMostBytes);
      ASSERT_TRUE(decode_slice(slices[next], surface, levels).ok());
      slices.erase(slices.begin() + static_cast<std::ptrdiff_t>(next));
    }
    ASSERT_EQ(surface, current);
    ASSERT_EQ(levels, after);
  }
}

}  // namespace
}  // namespace trocar::wire
