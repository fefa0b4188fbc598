#pragma once

// A sink for the log that bounds what strangers can make a program write: of lines of level info
// and warn it passes on 300 at once and 10 per second in the long run. The next line after a gap
// says how many were left out. Errors and debug lines always pass.

#include <spdlog/sinks/base_sink.h>

#include <functional>
#include <memory>
#include <mutex>

#include "common/base/timing.h"

namespace trocar::log {

class BoundedSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  static constexpr double kMostAtOnce = 300, kPerSecond = 10;

  explicit BoundedSink(std::shared_ptr<spdlog::sinks::sink> inner,
                       std::function<std::uint64_t()> clock_ns = monotonic_ns)
      : inner_(std::move(inner)), clock_ns_(std::move(clock_ns)), last_ns_(clock_ns_()) {}

 protected:
  void sink_it_(const spdlog::details::log_msg& line) override;
  void flush_() override { inner_->flush(); }
  void set_pattern_(const std::string& pattern) override { inner_->set_pattern(pattern); }
  void set_formatter_(std::unique_ptr<spdlog::formatter> formatter) override {
    inner_->set_formatter(std::move(formatter));
  }

 private:
  bool may_pass();

  const std::shared_ptr<spdlog::sinks::sink> inner_;
  const std::function<std::uint64_t()> clock_ns_;
  double allowance_ = kMostAtOnce;  // lines
  std::uint64_t last_ns_, left_out_ = 0;
};

}  // namespace trocar::log
