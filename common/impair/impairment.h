#pragma once

// A bad network, as figures and as decisions. Nothing here reads a clock or a socket: time is
// handed in, and what chance decides comes from a seed.
//
//   Impairment   what one direction does to packets
//   Outage       an interval in which nothing passes
//   Draws        chance: a number in [0, 1) for each packet and purpose
//   LossRuns     which packets of a sequence are lost (Gilbert 1960: two states, "good" loses none
//                and "bad" all)
//   Link         the cap on the rate, with its bounded backlog
//   Direction    what all flows of one direction share, and the totals of what became of packets
//
// Decisions about packet n of a flow depend on the flow's seed, on n and, for runs of losses, on
// the decisions before: not on time, on other flows or on the other options.
//
// Thread: one at a time.

#include <array>
#include <chrono>
#include <cstdint>

namespace trocar::impair {

using Time = std::chrono::nanoseconds;  // since the proxy has started
inline constexpr Time kNever = Time::max();
// A queue itself takes about so much for each packet that waits in it.
inline constexpr std::size_t kOverhead = 128;

struct Impairment {
  Time delay{0};       // one way
  Time jitter{0};      // up to so much more, uniform
  double loss = 0;     // share of packets
  double burst = 0;    // mean length of runs of lost packets; 0: each by itself
  double reorder = 0;  // share of datagrams that the next one overtakes, up to 0.5
  double duplicate = 0;
  double rate = 0;                       // bytes per second; 0: no cap
  Time queue = std::chrono::seconds(1);  // the longest backlog before the cap
};

struct Outage {
  Time begin = kNever, end = kNever;
  bool contains(Time time) const { return time >= begin && time < end; }
};

enum class Purpose : std::uint8_t { Loss, Jitter, Reorder, Duplicate, Again };

class Draws {
 public:
  explicit Draws(std::uint64_t seed) : seed_(seed) {}
  // Purpose::Again may be drawn up to 64 times, all others once: `turn` is 0.
  double draw(std::uint64_t packet, Purpose purpose, std::uint64_t turn = 0) const;

 private:
  std::uint64_t seed_;
};

// The seed of one direction of one flow: flows are numbered as they come.
enum class Flow : std::uint8_t { StreamUp, StreamDown, DatagramsUp, DatagramsDown };
std::uint64_t seed_of(std::uint64_t seed, Flow flow, std::uint64_t number);

class LossRuns {
 public:
  explicit LossRuns(const Impairment& impairment);
  // Whether the next packet is lost. `draw` is uniform in [0, 1).
  bool next(double draw);

 private:
  double begin_, go_on_;  // probabilities of a loss after a packet that passed, after a lost one
  bool is_lost_ = false;
};
// Runs as short as `burst` cannot lose as much as `loss` if this is longer.
double shortest_burst(double loss);

// A bucket of tokens that holds one packet: each leaves when those before it have had their time.
class Link {
 public:
  explicit Link(const Impairment& impairment);
  bool has_room(Time now) const { return now >= room_at(); }
  // When there is room again, if nothing more is sent.
  Time room_at() const;
  // Returns when the last byte has left.
  Time send(Time now, std::size_t bytes);

 private:
  double rate_;
  Time queue_, free_at_{0};
};

struct Amount {
  std::uint64_t packets = 0, bytes = 0;
  void add(std::size_t size) {
    ++packets;
    bytes += size;
  }
};

// How long packets took, in buckets 3 % wide at most. It keeps its size.
class Delays {
 public:
  void add(Time delay);
  double mean_ms() const;
  // The delay that this share of packets did not exceed.
  double share_ms(double share) const;

 private:
  static constexpr int kBits = 5;  // 32 buckets for each doubling
  static constexpr std::size_t kBuckets = 1024;
  static std::size_t bucket_of(std::uint64_t microseconds);
  static double middle_of(std::size_t bucket);
  std::array<std::uint64_t, kBuckets> counts_{};
  std::uint64_t count_ = 0;
  double sum_us_ = 0;
};

struct Totals {
  Amount passed;
  Amount lost;        // of a stream: each time that a segment was
  Amount blocked;     // by an outage of datagrams
  Amount duplicated;  // the copies
  Amount reordered;
  Amount dropped;  // because a queue was full
  Delays delays;   // of what passed
};

struct Direction {
  explicit Direction(const Impairment& chosen) : impairment(chosen), link(chosen) {}
  const Impairment impairment;
  Link link;
  Totals stream, datagrams;
};

}  // namespace trocar::impair
