// How long wrong tries make somebody wait, with a clock of the test's own.

#include "server/session/access/try_limiter.h"

#include <gtest/gtest.h>

namespace trocar::access {
namespace {

constexpr std::uint64_t kSecond = 1'000'000'000;

TEST(TryLimiter, after_five_wrong_tries_the_wait_doubles_up_to_a_minute) {
  TryLimiter limiter;
  std::uint64_t now = 1000 * kSecond;
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(limiter.seconds_to_wait("10.0.0.1", now), 0u);
    limiter.record_wrong_try("10.0.0.1", now);
  }
  for (const std::uint64_t wait : {1, 2, 4, 8, 16, 32, 60, 60, 60}) {
    EXPECT_EQ(limiter.seconds_to_wait("10.0.0.1", now), 0u);
    limiter.record_wrong_try("10.0.0.1", now);
    EXPECT_EQ(limiter.seconds_to_wait("10.0.0.1", now), wait);
    EXPECT_EQ(limiter.seconds_to_wait("10.0.0.2", now), 0u) << "another address";
    EXPECT_EQ(limiter.seconds_to_wait("10.0.0.1", now + wait * kSecond - 1), 1u);
    now += wait * kSecond;
  }
  now += (TryLimiter::kForgetSeconds + 1) * kSecond;
  limiter.record_wrong_try("10.0.0.9", now);
  EXPECT_EQ(limiter.address_count(), 1u) << "ten quiet minutes are forgotten";
}

TEST(TryLimiter, all_addresses_together_have_twenty_wrong_tries_a_second) {
  TryLimiter limiter;
  const std::uint64_t now = 1000 * kSecond;
  for (int i = 0; i < TryLimiter::kMostPerSecond; ++i) {
    const auto address = "10.0.1." + std::to_string(i);
    EXPECT_EQ(limiter.seconds_to_wait(address, now), 0u);
    limiter.record_wrong_try(address, now);
  }
  EXPECT_EQ(limiter.seconds_to_wait("10.0.2.1", now), 1u);
  EXPECT_EQ(limiter.seconds_to_wait("10.0.2.1", now + kSecond), 0u);
}

TEST(TryLimiter, the_table_is_bounded_and_an_address_of_ipv6_counts_as_its_network) {
  TryLimiter limiter;
  for (int i = 0; i < 5000; ++i)
    limiter.record_wrong_try("10.1." + std::to_string(i / 250) + "." + std::to_string(i % 250),
                             static_cast<std::uint64_t>(i) * kSecond / 100);
  EXPECT_EQ(limiter.address_count(), TryLimiter::kMostAddresses);
}

}  // namespace
}  // namespace trocar::access
