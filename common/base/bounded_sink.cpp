#include "common/base/bounded_sink.h"

#include <algorithm>
#include <string>

namespace trocar::log {

bool BoundedSink::may_pass() {
  const auto now = clock_ns_();
  const double seconds = static_cast<double>(now - last_ns_) * 1e-9;
  last_ns_ = now;
  allowance_ = std::min(kMostAtOnce, allowance_ + seconds * kPerSecond);
  if (allowance_ < 1) return false;
  allowance_ -= 1;
  return true;
}

void BoundedSink::sink_it_(const spdlog::details::log_msg& line) {
  const bool is_bounded = line.level == spdlog::level::info || line.level == spdlog::level::warn;
  if (is_bounded && !may_pass()) {
    ++left_out_;
    return;
  }
  if (left_out_ > 0) {
    const auto text = std::to_string(left_out_) + " lines were left out before this one: too many";
    left_out_ = 0;
    inner_->log({line.time, line.source, line.logger_name, spdlog::level::warn, text});
  }
  inner_->log(line);
}

}  // namespace trocar::log
