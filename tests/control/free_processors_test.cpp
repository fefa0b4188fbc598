#include "server/app/server/free_processors.h"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

namespace trocar::app {
namespace {

TEST(FreeProcessors, AreThoseOfTheTimeSinceTheLastCall) {
  FreeProcessors free;
  EXPECT_EQ(free.read(), 0) << "nothing is known yet";
  for (int i = 0; i < 3; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    const double count = free.read();
    EXPECT_GE(count, 0);
    // The kernel counts hundredths of a second.
    EXPECT_LE(count, 1.2 * std::thread::hardware_concurrency());
  }
}

}  // namespace
}  // namespace trocar::app
