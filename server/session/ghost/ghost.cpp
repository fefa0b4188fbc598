#include "server/session/ghost/ghost.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>

#include "common/base/log.h"
#include "common/base/timing.h"

namespace trocar::ghost {
namespace {

constexpr int kNiceness = 10;
constexpr std::uint64_t kRequestNs = 1'000'000'000, kWarningNs = 10'000'000'000;

}  // namespace

Ghost::Ghost(const step::Simulation& session, GhostOptions options)
    : session_(session), options_(std::move(options)) {}

Ghost::~Ghost() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  wake_.notify_one();
  if (thread_.joinable()) thread_.join();
}

void Ghost::set_wanted(bool is_wanted) {
  {
    const std::lock_guard lock(mutex_);
    is_wanted_ = is_wanted;
    queue_.clear();
    has_lost_ = false;
  }
  if (is_wanted && !thread_.joinable()) thread_ = std::thread([this] { run(); });
  wake_.notify_one();
}

void Ghost::push(std::span<const step::SharedFrame> frames) {
  {
    const std::lock_guard lock(mutex_);
    if (!is_wanted_ || frames.empty()) return;
    if (queue_.size() + frames.size() > kMostFrames) {
      queue_.clear();
      has_lost_ = true;
    }
    // If there are very many, the last of them are lost.
    const auto kept = std::min(frames.size(), kMostFrames);
    queue_.insert(queue_.end(), frames.end() - static_cast<std::ptrdiff_t>(kept), frames.end());
    newest_tick_ = frames.back()->tick;
  }
  wake_.notify_one();
}

GhostCounters Ghost::counters() const {
  const std::lock_guard lock(mutex_);
  return counters_;
}

void Ghost::run() {
  // Linux: of this thread alone. Where it is refused the ghost is only less polite.
  (void)setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNiceness);
  while (const auto frame = next_frame()) {
    if (!follower_) follower_.emplace(session_, options_.decisions);
    const auto before = follower_->status();
    follower_->repeat(*frame);
    if (before != GhostStatus::Follows && follower_->status() == GhostStatus::Follows) {
      const std::lock_guard lock(mutex_);
      ++counters_.begun;
    }
    if (follower_->wants_snapshot()) request_snapshot();
    report(*frame);
  }
}

step::SharedFrame Ghost::next_frame() {
  std::unique_lock lock(mutex_);
  for (;;) {
    if (!is_wanted_ && follower_) {
      follower_.reset();
      reported_ = GhostStatus::Begins;
    }
    if (is_ending_) return nullptr;
    if (has_lost_) {
      has_lost_ = false;
      ++counters_.fallen;
      if (follower_) follower_->lose();
      const auto now = monotonic_ns();
      if (warned_ns_ == 0 || now - warned_ns_ >= kWarningNs) {
        warned_ns_ = now;
        log::warn("the ghost of the full solution does not keep up: it begins again");
      }
    }
    if (is_wanted_ && !queue_.empty()) {
      auto frame = std::move(queue_.front());
      queue_.pop_front();
      return frame;
    }
    wake_.wait(lock);
  }
}

// While it waits, for what, at once and now and then: a report may not reach everybody.
void Ghost::report(const step::PublishedFrame& frame) {
  const auto status = follower_->status();
  const bool follows = status == GhostStatus::Follows;
  if (frame.frame % kFramesPerReport != 0 && (follows || status == reported_)) return;
  reported_ = status;
  auto report = std::make_shared<GhostReport>();
  if (follows)
    *report = follower_->compare(frame);
  else
    report->status = status;
  {
    const std::lock_guard lock(mutex_);
    report->behind_ticks = newest_tick_ > frame.tick ? newest_tick_ - frame.tick : 0;
    if (follows) {
      ++counters_.frames;
      counters_.largest_m = std::max(counters_.largest_m, report->largest_m);
    }
  }
  options_.publish(std::move(report));
}

void Ghost::request_snapshot() {
  const auto now = monotonic_ns();
  if (requested_ns_ != 0 && now - requested_ns_ < kRequestNs) return;
  requested_ns_ = now;
  options_.request_snapshot();
}

}  // namespace trocar::ghost
