#pragma once

// This line on stderr says how far long work is. It is rewritten on a terminal; files and pipes get
// a line of their own about every ten seconds.

#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <string>

#include "common/base/timing.h"

namespace trocar {

class ProgressLine {
 public:
  explicit ProgressLine(const char* program, bool is_terminal = ::isatty(STDERR_FILENO) != 0,
                        std::uint64_t now_ns = monotonic_ns())
      : program_(program), is_terminal_(is_terminal), begin_ns_(now_ns), said_ns_(now_ns) {}

  // Stages come one after the other; each ends with done == all. done is at least 1.
  void show(const char* stage, std::size_t done, std::size_t all) {
    std::fputs(text(stage, done, all, monotonic_ns()).c_str(), stderr);
  }
  // Returns what is to be written at this time; empty: nothing.
  std::string text(const char* stage, std::size_t done, std::size_t all, std::uint64_t now_ns) {
    const double seconds = static_cast<double>(now_ns - begin_ns_) * 1e-9;
    if (done == all) begin_ns_ = now_ns;
    if (!is_terminal_ && now_ns - said_ns_ < kPlainNs) return {};
    said_ns_ = now_ns;
    char line[160];
    std::snprintf(line, sizeof line, "%s%s: %s %zu of %zu, %.0f s to go%s",
                  is_terminal_ ? "\r" : "", program_, stage, done, all,
                  seconds * static_cast<double>(all - done) / static_cast<double>(done),
                  is_terminal_ && done < all ? "  " : "\n");
    return line;
  }

 private:
  static constexpr std::uint64_t kPlainNs = 10'000'000'000;

  const char* const program_;
  const bool is_terminal_;
  std::uint64_t begin_ns_, said_ns_;
};

}  // namespace trocar
