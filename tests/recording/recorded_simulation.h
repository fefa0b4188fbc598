#pragma once

// A session without a server: hands press, grasp and cut a small liver, and the recorder writes it.
// The first hand feels.
// Then copies of the file, with what a test changes in them.

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "common/base/bytes.h"
#include "common/base/tick.h"
#include "common/base/version.h"
#include "server/tissue/step/tick.h"

namespace google::protobuf {
class Message;
}

namespace trocar::recording::testing {

inline constexpr Tick kRecordedTicks = 2400;
// Snapshots are of tick 0 and of these.
inline constexpr Tick kSnapshotTicks[] = {808, 1608};

// The client of hand 0 has a clock of its own, and reports from this tick on.
inline constexpr std::uint64_t kClientStart_us = 5'000'000;
inline constexpr Tick kFirstReportTick = 256;

// dropped_at: a frame that is too large for the recorder's queue, or 0. rules: those that the
// recording keeps.
void record_simulation(const std::string& path, Tick dropped_at = 0,
                       const step::SceneRules& rules = {});

// The file of a simulation that is recorded once in a process: to be read and copied only.
const std::string& recorded_simulation();

// A message of a recording while it is copied. False: it is left out.
using Edit = std::function<bool(std::string_view topic, google::protobuf::Message& message)>;
void copy_journal(const std::string& from, const std::string& to, const Edit& edit,
                  std::uint32_t sim_version = kSimVersion);

}  // namespace trocar::recording::testing
