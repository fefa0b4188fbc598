#pragma once

// One direction of one stream. A proxy above TCP cannot lose segments of a stream that passes it,
// so this does to the bytes what TCP does about losses below:
//
//   - Bytes are cut into segments of 1,400. Each transmission of one is lost with the probability
//     of the impairment, a first one perhaps in runs.
//   - A lost segment is sent again after one round trip when three segments that follow it within a
//     round trip arrive (fast retransmit); otherwise after a timeout of 200 ms, or of a round trip
//     if that is longer. Each further timeout of the segment is twice as long, up to a minute.
//   - What follows a lost segment waits for it: the order is kept.
//   - In an outage all that is sent is lost. The stream goes on with the first try after its end.
//
// Not modelled: the handshake, congestion control, loss of acknowledgements.
//
// Back-pressure: whoever pushes asks has_room() before. A chunk of up to chunk_bytes() may exceed
// the bounds then, so that memory stays below kMostBytes and one chunk.
// Thread: one at a time. Times of calls do not fall.

#include <deque>
#include <vector>

#include "common/base/bytes.h"
#include "common/impair/impairment.h"

namespace trocar::impair {

enum class StreamEnd : std::uint8_t { None, Finished, Reset };

class StreamLine {
 public:
  static constexpr std::size_t kSegmentBytes = 1400;
  static constexpr std::size_t kMostBytes = 1024 * 1024;

  // `direction` outlives this. The round trip is without losses and jitter's extremes.
  StreamLine(Direction& direction, const Outage& cut, Time round_trip, std::uint64_t seed);

  bool has_room(Time now) const { return bytes_ < kMostBytes && direction_.link.has_room(now); }
  // When the link has room; segments that depart make room, too.
  Time room_at() const { return direction_.link.room_at(); }
  // How much to push at once, so that a slow link's backlog stays near its bound.
  std::size_t chunk_bytes() const;
  void push(Time now, BytesView bytes);
  // The stream ends behind what has been pushed.
  void end(Time now, StreamEnd how);

  // When the next segment departs; kNever if none does. A push may bring it forward.
  Time next() const;
  struct Departure {
    Bytes bytes;
    StreamEnd end = StreamEnd::None;
  };
  // Takes the next one out, whose time has come.
  Departure pop(Time now);
  std::size_t waiting_bytes() const { return bytes_; }

 private:
  struct Segment {
    Time entered, sent, jitter;
    int losses = 0;
    bool is_fast = false;  // its first loss is repaired by fast retransmit
    Time arrival{0};
    Bytes bytes;
    StreamEnd end = StreamEnd::None;
  };
  struct Unacknowledged {  // lost, and perhaps repaired by fast retransmit
    std::uint64_t number;
    int followers;
  };

  void send(Time now, BytesView bytes, StreamEnd end);
  int draw_losses(std::uint64_t number);
  Time arrival_of(const Segment& segment);
  // When something sent at this time gets through the outage.
  Time through_cut(Time sent);
  void acknowledge_follower(Time sent);

  Direction& direction_;
  const Outage cut_;
  const Time round_trip_, timeout_;
  const Draws draws_;
  LossRuns losses_;
  std::deque<Segment> segments_;
  std::vector<Unacknowledged> unacknowledged_;
  std::uint64_t first_ = 0;  // number of segments_.front()
  Time last_departure_{0};
  Time resumed_ = kNever;  // the first try after the outage, once something was sent in it
  std::size_t bytes_ = 0;
};

}  // namespace trocar::impair
