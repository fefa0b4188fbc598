#include "common/impair/stream_line.h"

#include <algorithm>

namespace trocar::impair {
namespace {

constexpr std::size_t kMostChunk = 64 * 1024;
constexpr Time kShortestTimeout = std::chrono::milliseconds(200);
constexpr Time kLongestTimeout = std::chrono::minutes(1);
constexpr int kMostLosses = 15;  // Linux gives a connection up after as many
constexpr int kFollowers = 3;    // duplicate acknowledgements for fast retransmit, RFC 5681

}  // namespace

StreamLine::StreamLine(Direction& direction, const Outage& cut, Time round_trip, std::uint64_t seed)
    : direction_(direction),
      cut_(cut),
      round_trip_(round_trip),
      timeout_(std::max(kShortestTimeout, round_trip)),
      draws_(seed),
      losses_(direction.impairment) {}

std::size_t StreamLine::chunk_bytes() const {
  const auto& impairment = direction_.impairment;
  if (impairment.rate <= 0) return kMostChunk;
  const double backlog = impairment.rate * static_cast<double>(impairment.queue.count()) * 1e-9;
  return static_cast<std::size_t>(std::clamp(backlog, double{kSegmentBytes}, double{kMostChunk}));
}

void StreamLine::push(Time now, BytesView bytes) {
  while (!bytes.empty()) {
    const auto size = std::min(bytes.size(), kSegmentBytes);
    send(now, bytes.first(size), StreamEnd::None);
    bytes = bytes.subspan(size);
  }
}

void StreamLine::end(Time now, StreamEnd how) {
  send(now, {}, how);
}

int StreamLine::draw_losses(std::uint64_t number) {
  if (!losses_.next(draws_.draw(number, Purpose::Loss))) return 0;
  int losses = 1;
  while (losses < kMostLosses &&
         draws_.draw(number, Purpose::Again, static_cast<std::uint64_t>(losses)) <
             direction_.impairment.loss)
    ++losses;
  return losses;
}

Time StreamLine::through_cut(Time sent) {
  if (!cut_.contains(sent)) return sent;
  if (cut_.end == kNever) return kNever;
  if (resumed_ == kNever) {
    resumed_ = sent;
    for (Time timeout = timeout_; resumed_ < cut_.end;
         timeout = std::min(2 * timeout, kLongestTimeout))
      resumed_ += timeout;
  }
  return resumed_;
}

Time StreamLine::arrival_of(const Segment& segment) {
  Time sent = through_cut(segment.sent);
  Time timeout = timeout_;
  for (int i = 0; i < segment.losses && sent != kNever; ++i) {
    if (i == 0 && segment.is_fast) {
      sent += round_trip_;
    } else {
      sent += timeout;
      timeout = std::min(2 * timeout, kLongestTimeout);
    }
    sent = through_cut(sent);
  }
  return sent == kNever ? kNever : sent + direction_.impairment.delay + segment.jitter;
}

void StreamLine::acknowledge_follower(Time sent) {
  std::erase_if(unacknowledged_, [&](Unacknowledged& lost) {
    if (lost.number < first_) return true;
    auto& segment = segments_[static_cast<std::size_t>(lost.number - first_)];
    if (sent > segment.sent + round_trip_) return true;
    if (++lost.followers < kFollowers) return false;
    segment.is_fast = true;
    segment.arrival = arrival_of(segment);
    return true;
  });
}

void StreamLine::send(Time now, BytesView bytes, StreamEnd end) {
  const auto& impairment = direction_.impairment;
  const std::uint64_t number = first_ + segments_.size();
  Segment segment;
  segment.entered = now;
  segment.sent = direction_.link.send(now, bytes.size());
  segment.jitter = Time(static_cast<std::int64_t>(static_cast<double>(impairment.jitter.count()) *
                                                  draws_.draw(number, Purpose::Jitter)));
  segment.losses = draw_losses(number);
  segment.arrival = arrival_of(segment);
  segment.bytes.assign(bytes.begin(), bytes.end());
  segment.end = end;
  for (int i = 0; i < segment.losses; ++i) direction_.stream.lost.add(bytes.size());
  bytes_ += bytes.size() + kOverhead;
  const bool is_cut = cut_.contains(segment.sent);
  if (segment.losses == 0 && !is_cut) acknowledge_follower(segment.sent);
  if (segment.losses > 0 && !is_cut) unacknowledged_.push_back({number, 0});
  segments_.push_back(std::move(segment));
}

Time StreamLine::next() const {
  return segments_.empty() ? kNever : std::max(last_departure_, segments_.front().arrival);
}

StreamLine::Departure StreamLine::pop(Time now) {
  last_departure_ = next();
  auto segment = std::move(segments_.front());
  segments_.pop_front();
  ++first_;
  bytes_ -= segment.bytes.size() + kOverhead;
  if (segment.end == StreamEnd::None) {
    direction_.stream.passed.add(segment.bytes.size());
    direction_.stream.delays.add(now - segment.entered);
  }
  return {std::move(segment.bytes), segment.end};
}

}  // namespace trocar::impair
