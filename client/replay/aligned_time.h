#pragma once

// One time for two recordings that are seen beside each other. It begins at 0 and has parts. In
// each part both recordings run from where the part begins for them, and the one that has less of
// it waits at its end for the other. From the start of each, there is one part. By stages, a part
// begins where a stage of the lesson begins in both; of a lesson that was begun again, the last
// attempt counts.

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "client/replay/recorded_events.h"
#include "common/base/tick.h"

namespace trocar::replay {

inline constexpr std::size_t kPair = 2;

class AlignedTime {
 public:
  struct Span {
    Tick first = 0, last = 0;
  };
  using Spans = std::array<Span, kPair>;
  using Stages = std::array<std::span<const RecordedStage>, kPair>;
  // Says where a recording is at a time.
  struct Place {
    Tick tick = 0;
    bool is_waiting = false;  // it has no such time
    bool has_ended = false;   // and none will come
  };

  static AlignedTime from_start(const Spans& spans);
  // Nothing: they are not of the same lesson, or have no stage in common.
  static std::optional<AlignedTime> by_stage(const Spans& spans, const Stages& stages);

  Tick last() const { return last_; }
  Place place_in(std::size_t recording, Tick time) const;
  // The time from which on the recording goes on from `tick`.
  Tick time_of(std::size_t recording, Tick tick) const;

 private:
  struct Part {
    Tick time = 0;                       // it begins
    std::array<Tick, kPair> begin, end;  // in the recordings
  };
  void add(const std::array<Tick, kPair>& begin, const std::array<Tick, kPair>& end);

  std::vector<Part> parts_;
  Tick last_ = 0;
};

}  // namespace trocar::replay
