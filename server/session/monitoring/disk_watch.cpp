#include "server/session/monitoring/disk_watch.h"

#include <fmt/format.h>

#include <cmath>

namespace trocar::monitoring {
namespace {

// An index takes less than this share of a recording, and the last chunk less than these bytes.
constexpr double kIndexShare = 0.02;
constexpr double kLastBytes = 256 * 1024;

}  // namespace

bool DiskWatch::add(const DiskSample& sample) {
  samples_.push_back(sample);
  newest_ = sample;
  while (samples_.size() > 2 && sample.at_s - samples_[1].at_s >= kMostSpan_s) samples_.pop_front();
  const auto left = seconds_left();
  if (left && *left < kWarnBefore_s && !is_said_) return is_said_ = true;
  if (!left || *left > 2 * kWarnBefore_s) is_said_ = false;
  return false;
}

std::optional<double> DiskWatch::rate() const {
  if (samples_.empty()) return std::nullopt;
  const auto &first = samples_.front(), &last = samples_.back();
  const double span_s = last.at_s - first.at_s;
  if (span_s < kLeastSpan_s) return std::nullopt;
  if (last.recorded_bytes <= first.recorded_bytes) return 0.0;
  return static_cast<double>(last.recorded_bytes - first.recorded_bytes) / span_s;
}

std::optional<double> DiskWatch::seconds_left() const {
  const auto bytes_per_s = rate();
  if (!bytes_per_s || *bytes_per_s <= 0) return std::nullopt;
  return static_cast<double>(samples_.back().available_bytes) / *bytes_per_s;
}

std::string DiskWatch::warning() const {
  const auto left = seconds_left();
  if (!left || *left >= kWarnBefore_s) return {};
  return fmt::format("the disk of the recording will be full in about {} min",
                     static_cast<int>(std::ceil(*left / 60)));
}

bool DiskWatch::must_end() const {
  const auto bytes_per_s = rate();
  if (!bytes_per_s || *bytes_per_s <= 0) return false;
  const auto& last = samples_.back();
  const double wanted = kEndBefore_s * *bytes_per_s +
                        kIndexShare * static_cast<double>(last.recorded_bytes) + kLastBytes;
  return static_cast<double>(last.available_bytes) < wanted;
}

}  // namespace trocar::monitoring
