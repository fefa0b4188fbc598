#include "client/app/hand_reporter.h"

#include <utility>

namespace trocar::app {
namespace {

constexpr std::uint64_t kApart_us = 15'500;  // states are looked at every 4 ms
constexpr std::uint64_t kPause_us = 200'000;
constexpr std::uint32_t kNamedEvery = 64;  // reports: about 8 s

}  // namespace

std::optional<wire::HandReport> HandReporter::add(const haptics::HandState& state) {
  const std::uint64_t since_us = state.time_us - last_.time_us;
  if (last_.time_us != 0 && since_us < kApart_us) return std::nullopt;
  std::optional<wire::HandReport> full;
  if (!report_.moments.empty() && since_us > kPause_us) full = finished();
  if (report_.moments.empty()) begin(state);

  std::uint32_t limits = 0;
  for (std::size_t i = 0; i < limit_counts_.size(); ++i)
    if (state.limit_counts[i] != limit_counts_[i]) limits |= 1u << i;
  limit_counts_ = state.limit_counts;
  report_.moments.push_back(
      {state.time_us, to_float(state.hand_force_in_world_n), to_float(state.model_force_n),
       static_cast<std::uint32_t>(std::min(state.patch_age_s, 60.0) * 1e6), limits});
  last_ = state;
  if (report_.moments.size() == wire::HandReport::kMostMoments) full = finished();
  return full;
}

void HandReporter::begin(const haptics::HandState& state) {
  // The loop's rate is that since the end of the report before, unless a pause lies between.
  const bool goes_on = last_.time_us != 0 && state.time_us - last_.time_us <= kPause_us;
  begin_us_ = goes_on ? last_.time_us : state.time_us;
  begin_steps_ = goes_on ? last_.steps : state.steps;
}

wire::HandReport HandReporter::finished() {
  const double seconds = static_cast<double>(last_.time_us - begin_us_) * 1e-6;
  report_.rate_hz =
      seconds > 0 ? static_cast<float>(static_cast<double>(last_.steps - begin_steps_) / seconds)
                  : 0;
  report_.echo_delay_s = static_cast<float>(last_.answer_s);
  report_.motion_scale = static_cast<float>(scale_.motion);
  report_.force_scale = static_cast<float>(scale_.force);
  if (finished_++ % kNamedEvery == 0) report_.device = device_;
  return std::exchange(report_, {});
}

}  // namespace trocar::app
