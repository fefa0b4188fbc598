#include "common/base/mix.h"

#include <gtest/gtest.h>

#include <bit>

namespace trocar {
namespace {

// The generator's first numbers from 0 and from 1234567.
TEST(Mix, DrawsWhatSplitMix64Draws) {
  EXPECT_EQ(splitmix64(0), 0xe220a8397b1dcdafu);
  EXPECT_EQ(splitmix64(0x9e3779b97f4a7c15u), 0x6e789e6aa1b965f4u);
  EXPECT_EQ(splitmix64(1234567), 6457827717110365317u);
  EXPECT_EQ(mix_bits(0), 0u);
}

TEST(Mix, ChangesHalfOfTheBitsWhereOneBitChanges) {
  int changed = 0;
  for (int bit = 0; bit < 64; ++bit)
    changed += std::popcount(splitmix64(1) ^ splitmix64(1 ^ std::uint64_t{1} << bit));
  EXPECT_NEAR(changed / 64.0, 32, 1.5);
}

}  // namespace
}  // namespace trocar
