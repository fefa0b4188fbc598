#include "client/replica/interpolated_surface.h"

#include <algorithm>
#include <cmath>

namespace trocar::replica {
namespace {

constexpr std::uint64_t kPauseNs = 250'000'000;
constexpr std::size_t kArrivalWindow = 32;  // half a second
constexpr double kJumpTicks = 250;
constexpr std::size_t kDelayWindow = 128, kFramesForDelay = 16;
constexpr double kMarginTicks = 1;
constexpr std::uint64_t kGlideNs = 300'000'000;
constexpr double kSlewTicks = 120;  // an error of this size changes the speed by 100 %

Pose between(const Pose& a, const Pose& b, float t) {
  return {a.position * (1 - t) + b.position * t,
          ::trocar::interpolate(a.orientation, b.orientation, t)};
}

}  // namespace

void DisplayClock::restart() {
  arrivals_.clear();
  needed_ticks_.clear();
  delay_ticks_ = kFirstDelayTicks;
  display_tick_ = -1;
}

void DisplayClock::add_arrival(Tick tick, std::uint64_t arrival_ns) {
  // A pause (of a replay, or of the server) says nothing about the rate after it.
  if (!arrivals_.empty() && arrival_ns > arrivals_.back().ns + kPauseNs) arrivals_.clear();
  const Tick before = arrivals_.empty() ? tick : arrivals_.back().tick;
  arrivals_.push_back({tick, arrival_ns});
  if (arrivals_.size() > kArrivalWindow) arrivals_.pop_front();
  if (arrivals_.size() > 1) adapt_delay(static_cast<double>(tick - before));
}

void DisplayClock::adapt_delay(double ticks_since_last) {
  const auto& newest = arrivals_.back();
  const double late = tick_without_jitter(newest.ns) - static_cast<double>(newest.tick);
  needed_ticks_.push_back(late + ticks_since_last + kMarginTicks);
  if (needed_ticks_.size() > kDelayWindow) needed_ticks_.pop_front();
  if (needed_ticks_.size() < kFramesForDelay) return;
  std::vector<double> ascending(needed_ticks_.begin(), needed_ticks_.end());
  const auto at = ascending.begin() + static_cast<std::ptrdiff_t>(ascending.size() * 19 / 20);
  std::nth_element(ascending.begin(), at, ascending.end());
  const double most = kMostDelayTicks * std::max(1.0, rate() / kTicksPerSecond);
  delay_ticks_ = std::clamp(*at, kLeastDelayTicks, most);
}

double DisplayClock::tick_without_jitter(std::uint64_t now_ns) const {
  const double ticks_per_ns = rate() * 1e-9;
  double furthest = 0;
  for (const auto& arrival : arrivals_) {
    const auto since_ns =
        static_cast<double>(now_ns > arrival.ns ? now_ns - arrival.ns : std::uint64_t{0});
    furthest = std::max(furthest, static_cast<double>(arrival.tick) + since_ns * ticks_per_ns);
  }
  return furthest;
}

double DisplayClock::rate() const {
  const double nominal = static_cast<double>(kTicksPerSecond);
  if (arrivals_.size() < 4 || arrivals_.back().ns <= arrivals_.front().ns) return nominal;
  const double seconds = static_cast<double>(arrivals_.back().ns - arrivals_.front().ns) * 1e-9;
  const auto ticks = static_cast<double>(arrivals_.back().tick - arrivals_.front().tick);
  return std::clamp(ticks / seconds, 0.02 * nominal, 20 * nominal);
}

double DisplayClock::advance(std::uint64_t now_ns) {
  if (arrivals_.empty()) return display_tick_;
  const Arrival& newest = arrivals_.back();
  const auto newest_tick = static_cast<double>(newest.tick);
  const double speed = rate();
  const double target = std::min(newest_tick, tick_without_jitter(now_ns) - delay_ticks_);
  // A first frame is shown as it is.
  if (display_tick_ < 0 || std::abs(target - display_tick_) > kJumpTicks) {
    display_tick_ = arrivals_.size() == 1 ? newest_tick : target;
    last_ns_ = now_ns;
    return display_tick_;
  }
  const double elapsed = now_ns > last_ns_ ? static_cast<double>(now_ns - last_ns_) * 1e-9 : 0.0;
  last_ns_ = std::max(last_ns_, now_ns);
  const double step = elapsed * speed;
  const double slew = std::clamp((target - display_tick_ - step) / kSlewTicks, -1.0, 1.0);
  display_tick_ =
      std::max(display_tick_, std::min(display_tick_ + step * (1.0 + slew), newest_tick));
  return display_tick_;
}

void InterpolatedSurface::update(const Replica& replica, std::uint64_t now_ns) {
  const auto& history = replica.history();
  if (replica.history_version() != history_version_) restart(replica, now_ns);
  if (history.empty()) {
    is_valid_ = false;
    return;
  }
  for (const SessionFrame& frame : history) {
    if (has_tick_ && frame.tick <= last_tick_) continue;
    clock_.add_arrival(frame.tick, frame.arrival_ns);
    last_tick_ = frame.tick;
    has_tick_ = true;
  }
  tick_ = clock_.advance(now_ns);
  const SessionFrame* before = &history.front();
  const SessionFrame* after = before;
  for (const SessionFrame& frame : history) {
    after = &frame;
    if (static_cast<double>(frame.tick) >= tick_) break;
    before = &frame;
  }
  const double span = static_cast<double>(after->tick) - static_cast<double>(before->tick);
  const double t = span > 0 ? (tick_ - static_cast<double>(before->tick)) / span : 1.0;
  interpolate(replica.topology(), *before, *after, static_cast<float>(std::clamp(t, 0.0, 1.0)));
  is_valid_ = true;
  glide(now_ns);
}

void InterpolatedSurface::restart(const Replica& replica, std::uint64_t now_ns) {
  history_version_ = replica.history_version();
  clock_.restart();
  has_tick_ = false;
  const bool is_back = is_valid_ && replica.welcome_count() > welcome_count_;
  glide_from_ = is_back ? positions_ : std::vector<Vec3f>();
  glide_begin_ns_ = now_ns;
  welcome_count_ = replica.welcome_count();
}

// Vertices that are new since are where they are.
void InterpolatedSurface::glide(std::uint64_t now_ns) {
  if (glide_from_.empty()) return;
  const std::uint64_t since = now_ns > glide_begin_ns_ ? now_ns - glide_begin_ns_ : 0;
  if (since >= kGlideNs || glide_from_.size() > positions_.size()) return glide_from_.clear();
  const float share = static_cast<float>(since) / static_cast<float>(kGlideNs);
  for (std::size_t i = 0; i < glide_from_.size(); ++i)
    positions_[i] = glide_from_[i] * (1 - share) + positions_[i] * share;
}

void InterpolatedSurface::interpolate_threads(const SessionFrame& before, const SessionFrame& known,
                                              float t) {
  threads_ = known.threads;
  const auto& to = threads_.places;
  const auto& from = before.threads.places;
  const bool moves = before.has_state && from.size() == to.size();
  thread_places_.resize(to.size());
  for (std::size_t i = 0; i < to.size(); ++i) {
    const Vec3f end = wire::to_metres(to[i]);
    thread_places_[i] = moves ? wire::to_metres(from[i]) * (1 - t) + end * t : end;
  }
}

void InterpolatedSurface::interpolate(const Topology& topology, const SessionFrame& before,
                                      const SessionFrame& after, float t) {
  const auto& rest = topology.rest_positions;
  positions_.resize(rest.size());
  const float from = (1 - t) * wire::kQuantumMetres, to = t * wire::kQuantumMetres;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const auto& a = before.surface[i];
    const auto& b = after.surface[i];
    positions_[i] = {rest[i].x + from * static_cast<float>(a.x) + to * static_cast<float>(b.x),
                     rest[i].y + from * static_cast<float>(a.y) + to * static_cast<float>(b.y),
                     rest[i].z + from * static_cast<float>(a.z) + to * static_cast<float>(b.z)};
  }
  const bool bleeds = before.blood.size() == rest.size() && after.blood.size() == rest.size();
  blood_.resize(bleeds ? rest.size() : 0);
  for (std::size_t i = 0; i < blood_.size(); ++i)
    blood_[i] =
        (1 - t) * static_cast<float>(before.blood[i]) + t * static_cast<float>(after.blood[i]);
  // A frame whose FrameState is still under way shows what was known before it.
  const SessionFrame& known = after.has_state ? after : before;
  if (!known.has_state) return;
  tools_ = known.tools;
  regions_ = t < 0.5f && before.has_state ? before.regions : known.regions;
  interpolate_threads(before, known, t);
  if (&known == &before || !before.has_state) return;
  for (Tool& tool : tools_) {
    const auto earlier = std::ranges::find(before.tools, tool.slot, &Tool::slot);
    if (earlier == before.tools.end()) continue;
    tool.world_from_tool = between(earlier->world_from_tool, tool.world_from_tool, t);
    tool.world_from_proxy = between(earlier->world_from_proxy, tool.world_from_proxy, t);
    tool.force_n = earlier->force_n * (1 - t) + tool.force_n * t;
    tool.torque_nm = earlier->torque_nm * (1 - t) + tool.torque_nm * t;
  }
}

}  // namespace trocar::replica
