#include "common/base/workers.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <numeric>
#include <thread>
#include <vector>

namespace trocar {
namespace {

TEST(Workers, DoEachItemOnceInATeamThatChanges) {
  Workers workers(4);
  EXPECT_EQ(workers.most(), 4u);
  EXPECT_EQ(workers.count(), 4u);
  std::vector<std::atomic<int>> done(1000);
  for (int round = 0; round < 2000; ++round) {
    workers.use(1 + static_cast<unsigned>(round) * 7 % 4);
    const std::size_t n = static_cast<std::size_t>(round) * 37 % done.size();
    const std::size_t grain = 1 + static_cast<std::size_t>(round) % 9;
    std::atomic<bool> is_known{true};
    workers.for_each(n, grain, [&](std::size_t i, unsigned worker) {
      ++done[i];
      if (worker >= workers.most()) is_known = false;
    });
    ASSERT_TRUE(is_known);
    for (std::size_t i = 0; i < done.size(); ++i)
      ASSERT_EQ(done[i].exchange(0), i < n ? 1 : 0) << "round " << round << ", item " << i;
  }
}

// The caller and the next loop read what a loop has written.
TEST(Workers, ALoopSeesWhatTheOneBeforeItDid) {
  Workers workers(3);
  std::vector<std::uint64_t> values(500, 1), sums(500);
  for (int round = 0; round < 500; ++round) {
    workers.use(1 + static_cast<unsigned>(round) % 3);
    workers.for_each(values.size(), 3, [&](std::size_t i, unsigned) {
      sums[i] = values[i] + values[(i + 1) % values.size()];
    });
    workers.for_each(values.size(), 5, [&](std::size_t i, unsigned) { values[i] = sums[i] % 97; });
  }
  std::vector<std::uint64_t> expected(500, 1);
  for (int round = 0; round < 500; ++round) {
    const auto before = expected;
    for (std::size_t i = 0; i < expected.size(); ++i)
      expected[i] = (before[i] + before[(i + 1) % before.size()]) % 97;
  }
  EXPECT_EQ(values, expected);
}

TEST(Workers, OneAloneDoesAllInOrder) {
  Workers workers(1);
  std::vector<std::size_t> order;
  workers.for_each(100, 7, [&](std::size_t i, unsigned worker) {
    EXPECT_EQ(worker, 0u);
    order.push_back(i);
  });
  std::vector<std::size_t> expected(100);
  std::iota(expected.begin(), expected.end(), 0);
  EXPECT_EQ(order, expected);
}

TEST(Workers, DoAllWithManyMoreThreadsThanProcessors) {
  Workers workers(32);
  std::atomic<std::uint64_t> sum{0};
  for (int round = 0; round < 300; ++round) {
    if (round % 50 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));  // all sleep
    workers.for_each(200, 1, [&](std::size_t i, unsigned) { sum += i; });
  }
  EXPECT_EQ(sum, 300u * (199 * 200 / 2));
}

}  // namespace
}  // namespace trocar
