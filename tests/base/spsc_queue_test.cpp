#include "common/base/spsc_queue.h"

#include <gtest/gtest.h>

#include <memory>
#include <thread>

namespace trocar {
namespace {

TEST(SpscQueue, HoldsExactlyItsCapacityInOrder) {
  SpscQueue<int> queue(3);
  EXPECT_FALSE(queue.try_pop().has_value());
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(queue.try_push(i));
  EXPECT_FALSE(queue.try_push(3)) << "full";
  for (int i = 0; i < 3; ++i) EXPECT_EQ(queue.try_pop(), i);
  EXPECT_FALSE(queue.try_pop().has_value());
}

TEST(SpscQueue, WrapsAroundManyTimes) {
  SpscQueue<int> queue(2);
  for (int i = 0; i < 1000; ++i) {
    ASSERT_TRUE(queue.try_push(2 * i));
    ASSERT_TRUE(queue.try_push(2 * i + 1));
    ASSERT_EQ(queue.try_pop(), 2 * i);
    ASSERT_EQ(queue.try_pop(), 2 * i + 1);
  }
}

TEST(SpscQueue, APoppedElementIsNotKeptAlive) {
  SpscQueue<std::shared_ptr<int>> queue(4);
  auto value = std::make_shared<int>(1);
  const std::weak_ptr<int> watch = value;
  queue.try_push(std::move(value));
  queue.try_pop();
  EXPECT_TRUE(watch.expired());
}

// One producer, one consumer: everything arrives, once, in order, with its content.
TEST(SpscQueue, TwoThreadsLoseNothing) {
  constexpr int kCount = 200'000;
  SpscQueue<std::vector<int>> queue(64);
  std::thread producer([&] {
    for (int i = 0; i < kCount; ++i)
      while (!queue.try_push({i, -i})) std::this_thread::yield();
  });
  int expected = 0;
  int wrong = 0;
  while (expected < kCount) {
    const auto value = queue.try_pop();
    if (!value) {
      std::this_thread::yield();
      continue;
    }
    if (*value != std::vector<int>{expected, -expected}) ++wrong;
    ++expected;
  }
  producer.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_FALSE(queue.try_pop().has_value());
}

}  // namespace
}  // namespace trocar
