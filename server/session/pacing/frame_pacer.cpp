#include "server/session/pacing/frame_pacer.h"

#include <algorithm>
#include <cmath>

namespace trocar::pacing {
namespace {

constexpr std::uint64_t kPeriodNs = 10'000'000'000;
constexpr std::uint64_t kPatienceNs = 80'000'000;
constexpr double kFewFrames = 2;
constexpr int kManyLate = 4;
constexpr std::uint64_t kStarvedNs = 500'000'000;
constexpr std::uint64_t kRiseNs = 10'000'000;
constexpr int kMostDoublings = 4;
constexpr double kNewestShare = 0.125;

}  // namespace

void FramePacer::on_sent(Frame frame, std::uint64_t now_ns) {
  if (!sent_.empty() && frame <= sent_.back().frame) return;
  if (!has_room()) ++tries_;
  sent_.push_back({frame, now_ns});
  if (static_cast<double>(sent_.size()) > kMostFrames) sent_.pop_front();
}

void FramePacer::on_acknowledged(Frame frame, std::uint64_t now_ns) {
  const auto end = std::ranges::upper_bound(sent_, frame, {}, &Sent::frame);
  if (end == sent_.begin()) return;
  tries_ = 0;
  const auto last = *(end - 1);
  if (last.frame == frame) {
    learn(now_ns > last.ns ? now_ns - last.ns : 1, now_ns);
    adapt(static_cast<double>(end - sent_.begin()), frame);
  }
  sent_.erase(sent_.begin(), end);
}

void FramePacer::adapt(double acknowledged, Frame frame) {
  const bool has_losses = acknowledged > 1;  // or acknowledgements that came as one
  arriving_ *= std::pow(1 - kNewestShare, acknowledged);
  arriving_ += kNewestShare;
  const auto late_ns = last_ns_ - shortest_ns();
  late_in_a_row_ = late_ns < kEarlyNs ? 0 : late_in_a_row_ + 1;
  if (late_ns < kEarlyNs) {
    window_ = std::min(kMostFrames, window_ + acknowledged / window_);
  } else if ((late_ns > kLateNs || has_losses) && frame > narrowed_at_) {
    window_ = std::max(1.0, std::min(window_, static_cast<double>(sent_.size())) / 2);
    narrowed_at_ = sent_.back().frame;
  }
}

bool FramePacer::is_congested(std::uint64_t now_ns) const {
  const bool is_starved = static_cast<int>(sent_.size()) >= kManyLate &&
                          now_ns - sent_.front().ns > std::max(kStarvedNs, 4 * shortest_ns());
  if (is_starved) return true;
  return window_ < kFewFrames && arriving_ < 0.6 && late_in_a_row_ >= kManyLate;
}

void FramePacer::restart() {
  sent_.clear();
  window_ = kFewFrames;
  arriving_ = 1;
  tries_ = late_in_a_row_ = 0;
}

void FramePacer::learn(std::uint64_t elapsed_ns, std::uint64_t now_ns) {
  last_ns_ = elapsed_ns;
  if (shortest_[0] == 0 || now_ns - period_begin_ns_ > kPeriodNs) {
    // Our own frames may be what the link is never idle for: with one at a time it shows.
    if (shortest_[1] != 0 && shortest_[0] > shortest_[1] + kRiseNs) window_ = 1;
    period_begin_ns_ = now_ns;
    shortest_[1] = shortest_[0];
    shortest_[0] = elapsed_ns;
  }
  shortest_[0] = std::min(shortest_[0], elapsed_ns);
}

std::uint64_t FramePacer::shortest_ns() const {
  return shortest_[1] == 0 ? shortest_[0] : std::min(shortest_[0], shortest_[1]);
}

bool FramePacer::has_room() const {
  return static_cast<double>(sent_.size()) + 1 <= window_ + 1e-9;
}

bool FramePacer::may_send(std::uint64_t now_ns) const {
  if (has_room()) return true;
  const auto patience = (shortest_ns() + kPatienceNs) << std::min(tries_, kMostDoublings);
  return now_ns - sent_.back().ns > patience;
}

}  // namespace trocar::pacing
