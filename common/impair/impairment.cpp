#include "common/impair/impairment.h"

#include <algorithm>
#include <bit>

#include "common/base/mix.h"

namespace trocar::impair {
namespace {

constexpr std::uint64_t kDrawsPerPacket = 128;
constexpr double kMicrosecondsPerMillisecond = 1e3;

}  // namespace

double Draws::draw(std::uint64_t packet, Purpose purpose, std::uint64_t turn) const {
  const std::uint64_t place = packet * kDrawsPerPacket + static_cast<std::uint64_t>(purpose) + turn;
  return static_cast<double>(splitmix64(seed_ ^ splitmix64(place)) >> 11) * 0x1p-53;
}

std::uint64_t seed_of(std::uint64_t seed, Flow flow, std::uint64_t number) {
  return splitmix64(splitmix64(splitmix64(seed) + static_cast<std::uint64_t>(flow)) + number);
}

double shortest_burst(double loss) {
  return loss / (1 - loss);
}

LossRuns::LossRuns(const Impairment& impairment)
    : begin_(impairment.loss), go_on_(impairment.loss) {
  if (impairment.burst <= 0) return;
  begin_ = std::min(1.0, shortest_burst(impairment.loss) / impairment.burst);
  go_on_ = 1 - 1 / impairment.burst;
}

bool LossRuns::next(double draw) {
  is_lost_ = draw < (is_lost_ ? go_on_ : begin_);
  return is_lost_;
}

Link::Link(const Impairment& impairment) : rate_(impairment.rate), queue_(impairment.queue) {}

Time Link::room_at() const {
  return rate_ > 0 ? free_at_ - queue_ : Time::min();
}

Time Link::send(Time now, std::size_t bytes) {
  if (rate_ <= 0) return now;
  const double nanoseconds = static_cast<double>(bytes) / rate_ * 1e9;
  free_at_ = std::max(now, free_at_) + Time(static_cast<std::int64_t>(nanoseconds));
  return free_at_;
}

std::size_t Delays::bucket_of(std::uint64_t microseconds) {
  const int shift = std::max(0, static_cast<int>(std::bit_width(microseconds)) - kBits - 1);
  const auto bucket =
      (static_cast<std::size_t>(shift) << kBits) + static_cast<std::size_t>(microseconds >> shift);
  return std::min(bucket, kBuckets - 1);
}

double Delays::middle_of(std::size_t bucket) {
  constexpr std::size_t kFine = 2u << kBits;  // one microsecond each
  if (bucket < kFine) return static_cast<double>(bucket);
  const std::size_t shift = (bucket >> kBits) - 1;
  const std::size_t first = bucket - (shift << kBits);
  return (static_cast<double>(first) + 0.5) * static_cast<double>(std::uint64_t{1} << shift);
}

void Delays::add(Time delay) {
  const auto microseconds = std::max<std::int64_t>(0, delay.count() / 1000);
  ++counts_[bucket_of(static_cast<std::uint64_t>(microseconds))];
  ++count_;
  sum_us_ += static_cast<double>(microseconds);
}

double Delays::mean_ms() const {
  return count_ == 0 ? 0 : sum_us_ / static_cast<double>(count_) / kMicrosecondsPerMillisecond;
}

double Delays::share_ms(double share) const {
  double below = 0;
  for (std::size_t i = 0; i < kBuckets; ++i) {
    below += static_cast<double>(counts_[i]);
    if (below > 0 && below >= share * static_cast<double>(count_))
      return middle_of(i) / kMicrosecondsPerMillisecond;
  }
  return 0;
}

}  // namespace trocar::impair
