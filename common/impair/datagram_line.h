#pragma once

// One direction of the datagrams of one peer. What is pushed meets its fate at once: it is blocked,
// lost, dropped because a queue is full, or it waits until its time of departure.
//
//   1. An outage blocks it, or it is lost, or a copy is made.
//   2. The link's rate and backlog, which all flows of the direction share, say when it is sent.
//   3. It departs after delay and jitter, but not before those pushed earlier.
//   4. One that is reordered departs behind the next, or 100 ms late when none comes.
//
// Invariant: kMostBytes bounds the bytes that wait, each datagram with its overhead.
// Thread: one at a time. Times of calls do not fall.

#include <map>

#include "common/base/bytes.h"
#include "common/impair/impairment.h"

namespace trocar::impair {

class DatagramLine {
 public:
  static constexpr std::size_t kMostBytes = 256 * 1024;

  // `direction` outlives this.
  DatagramLine(Direction& direction, const Outage& blocked, std::uint64_t seed);

  void push(Time now, BytesView datagram);
  // When the next one departs; kNever if none waits. A push may bring it forward.
  Time next() const { return waiting_.empty() ? kNever : waiting_.begin()->first; }
  // Takes the next one out, whose time has come.
  Bytes pop(Time now);
  std::size_t waiting_bytes() const { return bytes_; }

 private:
  struct Waiting {
    Time entered;
    Bytes bytes;
  };
  using Queue = std::multimap<Time, Waiting>;  // equal times depart as they came

  // Whether the queues have room; the datagram is counted if not.
  bool admit(Time now, std::size_t size);
  Queue::iterator insert(Time departure, Time entered, BytesView datagram);
  void release_held(Time departure);

  Direction& direction_;
  const Outage blocked_;
  const Draws draws_;
  LossRuns losses_;
  Queue waiting_;
  Queue::iterator held_ = waiting_.end();  // waits to be overtaken
  Time last_in_order_{0};
  std::uint64_t count_ = 0;
  std::size_t bytes_ = 0;
};

}  // namespace trocar::impair
