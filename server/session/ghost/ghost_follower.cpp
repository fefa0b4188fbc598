#include "server/session/ghost/ghost_follower.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"

namespace trocar::ghost {

GhostFollower::GhostFollower(const step::Simulation& session, const step::TickDecisions& decisions)
    : simulation_(session.beside(1)), decisions_(decisions) {
  decisions_.is_reduction_off = true;
}

void GhostFollower::drop(GhostStatus status) {
  own_ = nullptr;
  status_ = status;
}

void GhostFollower::repeat(const step::PublishedFrame& frame) {
  // A snapshot in such a frame may be from before the change.
  if (frame.change || frame.new_layout || !frame.mark_events.empty()) {
    quiet_frames_ = 0;
    return drop(GhostStatus::Changed);
  }
  ++quiet_frames_;
  if (status_ != GhostStatus::Follows && !begin(frame)) return;
  if (!run(frame)) return drop(GhostStatus::Behind);
  own_ = simulation_.pop_frame();
  // It has cut where the session has not.
  if (!own_ || own_->epoch != frame.epoch || own_->surface.size() != frame.surface.size())
    drop(GhostStatus::Changed);
}

bool GhostFollower::begin(const step::PublishedFrame& frame) {
  if (!frame.snapshot || !simulation_.restore_snapshot(*frame.snapshot).ok()) return false;
  status_ = GhostStatus::Follows;
  return true;
}

// False: ticks are missing.
bool GhostFollower::run(const step::PublishedFrame& frame) {
  for (const auto& record : frame.records) {
    if (record.tick <= simulation_.current_tick()) continue;  // before the snapshot
    if (record.tick != simulation_.current_tick() + 1) return false;
    decisions_.depth_limit = record.decisions.depth_limit;
    simulation_.tick(record.inputs, decisions_);
  }
  return simulation_.current_tick() == frame.tick;
}

GhostReport GhostFollower::compare(const step::PublishedFrame& frame) const {
  TROCAR_ASSERT(status_ == GhostStatus::Follows && own_ && own_->tick == frame.tick);
  GhostReport report{
      .status = status_, .frame = frame.frame, .tick = frame.tick, .epoch = frame.epoch};
  report.offsets.reserve(frame.surface.size());
  // An offset is cut off at what can be sent.
  const auto offset = [](std::int32_t to, std::int32_t from) {
    return std::clamp(to - from, -wire::kMaxQuanta, wire::kMaxQuanta);
  };
  double sum = 0, largest = 0;
  for (std::size_t i = 0; i < frame.surface.size(); ++i) {
    const auto &to = own_->surface[i], &from = frame.surface[i];
    report.offsets.push_back({offset(to.x, from.x), offset(to.y, from.y), offset(to.z, from.z)});
    const auto squared =
        static_cast<double>(length_squared(wire::to_metres(report.offsets.back())));
    sum += squared;
    largest = std::max(largest, squared);
  }
  const auto count = std::max<std::size_t>(1, frame.surface.size());
  report.largest_m = static_cast<float>(std::sqrt(largest));
  report.root_mean_square_m = static_cast<float>(std::sqrt(sum / static_cast<double>(count)));
  return report;
}

}  // namespace trocar::ghost
