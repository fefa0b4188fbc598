#pragma once

// Makes reports of what a hand has felt, for the recording: the state of its loop every 16 ms,
// eight at a time. One thread.

#include <optional>
#include <string>

#include "client/haptics/hand.h"
#include "common/wire/hand_report.h"

namespace trocar::app {

class HandReporter {
 public:
  HandReporter(std::string device, const haptics::WorkspaceScale& scale)
      : device_(std::move(device)), scale_(scale) {}

  // Takes the newest state; the report that is full with it, or that another one follows after a
  // pause.
  std::optional<wire::HandReport> add(const haptics::HandState& state);

 private:
  wire::HandReport finished();
  void begin(const haptics::HandState& state);

  const std::string device_;
  const haptics::WorkspaceScale scale_;
  wire::HandReport report_;
  haptics::Safety::Counts limit_counts_{};
  std::uint64_t begin_us_ = 0, begin_steps_ = 0;  // of the report
  std::uint32_t finished_ = 0;
  haptics::HandState last_;  // in the report
};

}  // namespace trocar::app
