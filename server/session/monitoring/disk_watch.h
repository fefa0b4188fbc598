#pragma once

// How long the disk lasts at the rate at which a recording grows. The rate is that of the last
// minutes, so that one busy moment is no alarm.

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

namespace trocar::monitoring {

struct DiskSample {
  double at_s = 0;                    // any clock that only goes on
  std::uint64_t recorded_bytes = 0;   // size of the recording
  std::uint64_t available_bytes = 0;  // of its file system, for this user
};

class DiskWatch {
 public:
  static constexpr double kLeastSpan_s = 20;  // a rate over less is none
  static constexpr double kMostSpan_s = 300;
  static constexpr double kWarnBefore_s = 3600;
  static constexpr double kEndBefore_s = 30;

  // Samples come in the order of their time. True: the disk will be full within an hour, and that
  // has not been said since it last had room for two.
  bool add(const DiskSample& sample);

  const std::optional<DiskSample>& newest() const { return newest_; }
  // Bytes per second; nothing until samples span kLeastSpan_s.
  std::optional<double> rate() const;
  // Seconds until the disk is full; nothing while the recording does not grow.
  std::optional<double> seconds_left() const;
  // One sentence for people while less than an hour is left; else empty.
  std::string warning() const;
  // Room is left for what waits and for the index, and for little more: end the recording now.
  bool must_end() const;

 private:
  std::deque<DiskSample> samples_;
  std::optional<DiskSample> newest_;
  bool is_said_ = false;
};

}  // namespace trocar::monitoring
