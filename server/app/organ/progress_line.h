#pragma once

// How far long work is, on stderr: one line that is rewritten on a terminal, elsewhere one every
// few seconds.

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
    if (!is_terminal_ && done < all && now - shown_ < kEvery_ns) return;
    shown_ = now;
    std::fprintf(stderr, "%s%s: %s %zu of %zu, %.0f s to go%s", is_terminal_ ? "\r" : "", program_,
                 stage, done, all,
                 seconds * static_cast<double>(all - done) / static_cast<double>(done),
                 is_terminal_ && done < all ? "  " : "\n");
  }

 private:
  static constexpr std::uint64_t kEvery_ns = 5'000'000'000;

  const char* const program_;
  const bool is_terminal_ = ::isatty(STDERR_FILENO) != 0;
  std::uint64_t begin_ = monotonic_ns(), shown_ = begin_;
};

}  // namespace trocar::app
