#pragma once

// This line on stderr says how far long work is. It is rewritten on a terminal; files and pipes get
// nothing.

#include <unistd.h>

#include <cstdio>

#include "common/base/timing.h"

namespace trocar::app {

class ProgressLine {
 public:
  explicit ProgressLine(const char* program) : program_(program) {}

  // Stages come one after the other; each ends with done == all.
  void show(const char* stage, std::size_t done, std::size_t all) {
    const auto now = monotonic_ns();
    const double seconds = static_cast<double>(now - begin_) * 1e-9;
    if (done == all) begin_ = now;
    if (!is_terminal_) return;
    std::fprintf(stderr, "\r%s: %s %zu of %zu, %.0f s to go%s", program_, stage, done, all,
                 seconds * static_cast<double>(all - done) / static_cast<double>(done),
                 done < all ? "  " : "\n");
  }

 private:
  const char* const program_;
  const bool is_terminal_ = ::isatty(STDERR_FILENO) != 0;
  std::uint64_t begin_ = monotonic_ns();
};

}  // namespace trocar::app
