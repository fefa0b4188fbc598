#include "common/base/time_slice.h"

#include <sys/syscall.h>
#include <unistd.h>

#include <cstdint>

namespace trocar {
namespace {

constexpr std::uint64_t kSliceNs = 100'000;

// The kernel's `struct sched_attr` in its first version; the C library has none.
struct SchedAttr {
  std::uint32_t size = sizeof(SchedAttr);
  std::uint32_t policy = 0;
  std::uint64_t flags = 0;
  std::int32_t nice = 0;
  std::uint32_t priority = 0;
  std::uint64_t runtime_ns = 0;
  std::uint64_t deadline_ns = 0;
  std::uint64_t period_ns = 0;
};

}  // namespace

bool ask_for_short_slices(pid_t thread) {
  SchedAttr attr;
  if (syscall(SYS_sched_getattr, thread, &attr, sizeof attr, 0) != 0) return false;
  constexpr std::uint32_t kOrdinary = 0;  // SCHED_OTHER; real-time threads have no slices
  if (attr.policy != kOrdinary) return true;
  attr.runtime_ns = kSliceNs;
  return syscall(SYS_sched_setattr, thread, &attr, 0) == 0;
}

}  // namespace trocar
