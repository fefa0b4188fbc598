// Slices of random surfaces: each decodes alone, in any order, and together they are the frame.

#include "common/wire/surface_slices.h"

#include <gtest/gtest.h>

#include "tests/wire/surface_states.h"

namespace trocar::wire {
namespace {

using testing::Random;
constexpr std::size_t kMostBytes = 1000;

TEST(SurfaceSlices, together_they_are_the_frame_in_any_order) {
  Random random(5);
  std::size_t most = 0;
  for (int round = 0; round < 300; ++round) {
    const auto vertices = 1 + random.below(4000);
    const auto baseline = testing::random_surface(random, vertices, 400);
    const auto farthest = static_cast<std::int32_t>(1 + random.below(200));
    const auto one_in = 1 + random.below(40);
    const auto current = testing::moved(random, baseline, one_in, farthest);
    auto slices = encode_slices(baseline, current, kMostBytes);
    ASSERT_FALSE(slices.empty());
    most = std::max(most, slices.size());
    auto surface = baseline;
    while (!slices.empty()) {
      const auto next = random.below(slices.size());
      ASSERT_LE(slices[next].payload.size(), kMostBytes);
      ASSERT_TRUE(decode_slice(slices[next], surface).ok());
      slices.erase(slices.begin() + static_cast<std::ptrdiff_t>(next));
    }
    ASSERT_EQ(surface, current);
  }
  EXPECT_GT(most, 8u);
}

TEST(SurfaceSlices, nothing_changed_is_one_and_far_too_much_is_none) {
  Random random(6);
  const auto surface = testing::random_surface(random, 1000, 400);
  const auto same = encode_slices(surface, surface, kMostBytes);
  ASSERT_EQ(same.size(), 1u);
  EXPECT_LE(same[0].payload.size(), 1u);
  const auto large = testing::random_surface(random, 60'000, kMaxQuanta);
  EXPECT_TRUE(encode_slices(QuantisedSurface(large.size()), large, kMostBytes).empty());
}

TEST(SurfaceSlices, runs_that_are_not_whole_blocks_of_the_surface_are_refused) {
  const QuantisedSurface baseline(200);
  const auto payload = encode_slices(baseline, baseline, kMostBytes).front().payload;
  const auto is_taken = [&](std::uint32_t first, std::uint32_t count) {
    auto surface = baseline;
    return decode_slice({first, count, payload}, surface).ok();
  };
  EXPECT_TRUE(is_taken(0, 200));
  EXPECT_TRUE(is_taken(64, 64));
  EXPECT_TRUE(is_taken(192, 8));
  EXPECT_FALSE(is_taken(0, 201));
  EXPECT_FALSE(is_taken(0, 65));
  EXPECT_FALSE(is_taken(1, 64));
  EXPECT_FALSE(is_taken(256, 0));
  EXPECT_FALSE(is_taken(0xffffffc0u, 0xffffffffu));
}

}  // namespace
}  // namespace trocar::wire
