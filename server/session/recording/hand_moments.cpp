#include "server/session/recording/hand_moments.h"

#include <algorithm>
#include <cmath>

namespace trocar::recording {
namespace {

constexpr double kTick_us = 1000;
constexpr Tick kFarTicks = 1000;     // a clock is not carried on for longer
constexpr double kFar_us = 100'000;  // moments farther apart have something else between them

}  // namespace

void HandMoments::add(const wire::HandRecord& record) {
  const auto& report = record.report;
  const bool goes_back =
      !moments_.empty() && report.moments.front().time_us <= moments_.back().felt.time_us;
  if (runs_.empty() || goes_back) runs_.push_back({moments_.size(), moments_.size()});
  if (!report.device.empty() && report.device != devices_.back()) devices_.push_back(report.device);
  for (const auto& moment : report.moments) moments_.push_back({moment, reports_.size()});
  runs_.back().end = moments_.size();
  reports_.push_back({report.echo_delay_s, report.rate_hz, report.motion_scale, report.force_scale,
                      devices_.size() - 1});
  if (record.echo_time_us == 0) return;
  // Ticks do not go back in a recording of ours.
  const Tick tick = anchors_.empty() ? record.tick : std::max(record.tick, anchors_.back().tick);
  anchors_.push_back({tick, record.echo_time_us, runs_.size() - 1});
}

std::optional<HandMoments::PoseTime> HandMoments::pose_time(Tick tick) const {
  const auto after = std::ranges::upper_bound(anchors_, tick, {}, &Anchor::tick);
  const auto is_close = [tick](const Anchor& anchor) {
    return (anchor.tick > tick ? anchor.tick - tick : tick - anchor.tick) <= kFarTicks;
  };
  const auto carried_on = [tick](const Anchor& from) {
    const double ticks = static_cast<double>(tick) - static_cast<double>(from.tick);
    return PoseTime{static_cast<double>(from.echo_time_us) + ticks * kTick_us, from.run};
  };
  const bool has_after = after != anchors_.end() && is_close(*after);
  const bool has_before = after != anchors_.begin() && is_close(*std::prev(after));
  if (!has_before) return has_after ? std::optional(carried_on(*after)) : std::nullopt;
  const auto& before = *std::prev(after);
  if (!has_after || after->run != before.run || after->echo_time_us <= before.echo_time_us)
    return carried_on(before);
  const double share =
      static_cast<double>(tick - before.tick) / static_cast<double>(after->tick - before.tick);
  const auto from_us = static_cast<double>(before.echo_time_us);
  const auto to_us = static_cast<double>(after->echo_time_us);
  return PoseTime{from_us + share * (to_us - from_us), before.run};
}

std::optional<FeltMoment> HandMoments::at(Tick tick) const {
  const auto time = pose_time(tick);
  if (!time) return std::nullopt;
  const auto begin = moments_.begin() + static_cast<std::ptrdiff_t>(runs_[time->run].first);
  const auto end = moments_.begin() + static_cast<std::ptrdiff_t>(runs_[time->run].end);
  const auto us_of = [](const Moment& moment) { return static_cast<double>(moment.felt.time_us); };
  const auto later = std::ranges::lower_bound(begin, end, time->us, {}, us_of);
  if (later == end || (later == begin && us_of(*later) > time->us)) return std::nullopt;
  const auto& b = *later;
  const auto& a = later == begin ? b : *std::prev(later);
  const double apart_us = us_of(b) - us_of(a);
  if (apart_us > kFar_us) return std::nullopt;
  const auto share = apart_us > 0 ? static_cast<float>((time->us - us_of(a)) / apart_us) : 1.0f;
  const auto between = [share](const Vec3f& from, const Vec3f& to) {
    return from + (to - from) * share;
  };
  const auto& report = reports_[b.report];
  return FeltMoment{.hand_force_n = between(a.felt.hand_force_n, b.felt.hand_force_n),
                    .model_force_n = between(a.felt.model_force_n, b.felt.model_force_n),
                    .limits = b.felt.limits,
                    .answer_age_s = static_cast<float>(b.felt.answer_age_us) * 1e-6f,
                    .echo_delay_s = report.echo_delay_s,
                    .rate_hz = report.rate_hz,
                    .motion_scale = report.motion_scale,
                    .force_scale = report.force_scale,
                    .device = devices_[report.device]};
}

}  // namespace trocar::recording
