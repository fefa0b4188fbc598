// A thread that asks for short slices keeps its priority, and so do the threads that it starts.

#include "common/base/time_slice.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <thread>

namespace trocar {
namespace {

// Reads `sched_runtime` of the kernel's `struct sched_attr`, its third 64-bit word, of this thread.
std::uint64_t slice_ns() {
  std::array<std::uint64_t, 6> attr{};
  if (syscall(SYS_sched_getattr, 0, attr.data(), sizeof attr, 0) != 0) return 0;
  return attr[3];
}

bool kernel_has_slices() {
  utsname name{};
  int major = 0, minor = 0;
  return uname(&name) == 0 && std::sscanf(name.release, "%d.%d", &major, &minor) == 2 &&
         (major > 6 || (major == 6 && minor >= 12));
}

TEST(TimeSlice, IsShortInTheThreadAndInThoseThatItStartsAndNowhereElse) {
  const auto before = slice_ns();
  const int niceness = getpriority(PRIO_PROCESS, 0);
  std::uint64_t of_asking = 0, of_started = 0;
  int niceness_after = -1;
  std::thread([&] {
    EXPECT_TRUE(ask_for_short_slices());
    of_asking = slice_ns();
    niceness_after = getpriority(PRIO_PROCESS, static_cast<id_t>(gettid()));
    std::thread([&] { of_started = slice_ns(); }).join();
  }).join();
  EXPECT_EQ(niceness_after, niceness);
  EXPECT_EQ(slice_ns(), before);
  if (!kernel_has_slices()) GTEST_SKIP() << "this kernel is older than Linux 6.12";
  EXPECT_EQ(of_asking, 100'000u);
  EXPECT_EQ(of_started, 100'000u);
}

TEST(TimeSlice, OfAThreadThatIsNotThereIsRefused) {
  EXPECT_FALSE(ask_for_short_slices(0x7fffffff));
}

}  // namespace
}  // namespace trocar
