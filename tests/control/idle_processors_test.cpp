#include "server/app/server/idle_processors.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <string>
#include <thread>

#include "common/base/timing.h"

namespace trocar::app {
namespace {

// A moment, and how long processors have stood idle until then, all together.
struct Sample {
  double at_s = 0, idle_s = 0;
};

Sample sample() {
  std::ifstream file("/proc/stat");
  std::string word;
  double user = 0, nice = 0, system = 0, idle = 0;
  file >> word >> user >> nice >> system >> idle;
  return {static_cast<double>(monotonic_ns()) * 1e-9,
          idle / static_cast<double>(::sysconf(_SC_CLK_TCK))};
}

TEST(IdleProcessors, AreTheMeanSinceTheLastCall) {
  IdleProcessors idle;
  EXPECT_EQ(idle.read(), 0) << "nothing is known yet";
  for (int i = 0; i < 3; ++i) {
    const auto before_last = sample();
    idle.read();
    const auto after_last = sample();
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    const auto before = sample();
    const double count = idle.read();
    const auto after = sample();
    // Between the samples inside and those outside.
    EXPECT_GE(count, (before.idle_s - after_last.idle_s) / (after.at_s - before_last.at_s) - 1e-6);
    EXPECT_LE(count, (after.idle_s - before_last.idle_s) / (before.at_s - after_last.at_s) + 1e-6);
  }
}

}  // namespace
}  // namespace trocar::app
