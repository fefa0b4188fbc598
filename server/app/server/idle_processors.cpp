#include "server/app/server/idle_processors.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cinttypes>
#include <cstdio>

#include "common/base/timing.h"

namespace trocar::app {

IdleProcessors::IdleProcessors() : file_(::open("/proc/stat", O_RDONLY | O_CLOEXEC)) {}

IdleProcessors::~IdleProcessors() {
  if (file_ >= 0) ::close(file_);
}

double IdleProcessors::read() {
  std::array<char, 256> text{};
  if (file_ < 0 || ::pread(file_, text.data(), text.size() - 1, 0) <= 0) return 0;
  // "cpu", then user, nice, system and idle, of all processors together.
  std::uint64_t idle = 0;
  if (std::sscanf(text.data(), "cpu %*u %*u %*u %" SCNu64, &idle) != 1) return 0;
  const double idle_s = static_cast<double>(idle) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  const double now_s = static_cast<double>(monotonic_ns()) * 1e-9;
  const double since_s = now_s - read_s_, more_s = idle_s - idle_s_;
  const bool is_first = read_s_ == 0;
  idle_s_ = idle_s, read_s_ = now_s;
  return is_first || since_s <= 0 || more_s < 0 ? 0 : more_s / since_s;
}

}  // namespace trocar::app
