#include "client/replay/paired_source.h"

#include <algorithm>
#include <cmath>

namespace trocar::replay {
namespace {

constexpr double kApartTicks = 400;  // at real time; farther apart it is moved
constexpr double kMostHurry = 0.2;   // it plays faster or slower by this share at most

}  // namespace

Result<std::unique_ptr<PairedSource>> PairedSource::open(const std::string& first,
                                                         const std::string& second,
                                                         std::optional<Alignment> wish,
                                                         ReplaySource::Clock clock) {
  auto round_ns = std::make_shared<std::uint64_t>(clock());
  const auto round = [round_ns] { return *round_ns; };
  Halves halves;
  for (std::size_t i = 0; i < kPair; ++i) {
    auto half = ReplaySource::open(i == 0 ? first : second, round);
    if (!half) return half.error();
    halves[i] = std::move(*half);
  }
  return std::unique_ptr<PairedSource>(
      new PairedSource(std::move(halves), std::move(round_ns), std::move(clock), wish));
}

PairedSource::PairedSource(Halves halves, std::shared_ptr<std::uint64_t> round_ns,
                           ReplaySource::Clock clock, std::optional<Alignment> wish)
    : halves_(std::move(halves)),
      round_ns_(std::move(round_ns)),
      clock_(std::move(clock)),
      wish_(wish),
      time_line_(AlignedTime::from_start(spans())),
      last_ns_(*round_ns_) {}

AlignedTime::Spans PairedSource::spans() const {
  AlignedTime::Spans spans;
  for (std::size_t i = 0; i < kPair; ++i)
    spans[i] = {halves_[i]->first_tick(), halves_[i]->last_tick()};
  return spans;
}

std::string PairedSource::name() const {
  return halves_[0]->name() + " beside " + halves_[1]->name();
}

std::string PairedSource::why_stopped(std::size_t i) const {
  if (halves_[i]->state() != replica::SourceState::Closed) return {};
  return halves_[i]->close_reason().text;
}

replica::SourceState PairedSource::state() const {
  const auto live = replica::SourceState::Live;
  return halves_[0]->state() == live || halves_[1]->state() == live ? live
                                                                    : replica::SourceState::Closed;
}

void PairedSource::close(const std::string& reason) {
  for (auto& half : halves_) half->close(reason);
}

std::optional<bool> PairedSource::has_stages() const {
  if (!story_) return std::nullopt;
  return by_stage_.has_value();
}

void PairedSource::align(Alignment by) {
  if (by == alignment_ || (by == Alignment::Stage && !by_stage_)) return;
  const Tick shown = place(0).tick;
  alignment_ = by;
  time_line_ = by == Alignment::Stage ? *by_stage_ : AlignedTime::from_start(spans());
  tell_story();
  seek(time_line_.time_of(0, shown));
}

// Stages are known once both files are read.
void PairedSource::read_stories() {
  if (story_) return;
  for (std::size_t i = 0; i < kPair; ++i) {
    if (!told_[i]) told_[i] = halves_[i]->recorded_story();
    if (!told_[i]) return;
  }
  by_stage_ = AlignedTime::by_stage(spans(), {told_[0]->stages, told_[1]->stages});
  tell_story();
  align(wish_.value_or(Alignment::Stage));
}

void PairedSource::tell_story() {
  auto story = std::make_shared<replica::PlaybackStory>();
  story->forces_n.assign(kForceBins, 0);
  const auto bin_of = [](double tick, Tick last) {
    const double share = tick / static_cast<double>(std::max<Tick>(last, 1));
    return static_cast<std::size_t>(std::clamp(share, 0.0, 1.0) * (kForceBins - 1));
  };
  for (std::size_t i = 0; i < kPair; ++i) {
    for (auto event : told_[i]->story.events) {
      event.tick = time_line_.time_of(i, event.tick);
      event.text = halves_[i]->name() + ": " + event.text;
      story->events.push_back(std::move(event));
    }
    const auto& forces = told_[i]->story.forces_n;
    if (forces.empty()) continue;
    for (std::size_t bin = 0; bin < kForceBins; ++bin) {
      const auto place = time_line_.place_in(
          i, time_line_.last() * static_cast<Tick>(bin) / static_cast<Tick>(kForceBins - 1));
      if (place.is_waiting) continue;
      const float force = forces[bin_of(static_cast<double>(place.tick), halves_[i]->last_tick())];
      story->forces_n[bin] = std::max(story->forces_n[bin], force);
    }
  }
  std::ranges::stable_sort(story->events, {}, &replica::PlaybackEvent::tick);
  story_ = std::move(story);
}

// Its last round has brought a half to where it was wanted at `before`.
void PairedSource::steer(std::size_t i, Tick before) {
  ReplaySource& half = *halves_[i];
  if (half.state() != replica::SourceState::Live) return;
  const auto wanted = place(i);
  const Tick at = half.position();
  if (!is_playing_ || wanted.is_waiting || wanted.tick >= half.last_tick()) {
    half.pause();
    // A part of a frame is not worth a seek where it has just been paused.
    const bool is_held = !is_moved_ && !wanted.is_waiting && wanted.tick < half.last_tick();
    const Tick apart = at > wanted.tick ? at - wanted.tick : wanted.tick - at;
    if (apart > (is_held ? kTicksPerFrame : 0)) half.seek(wanted.tick);
    return;
  }
  const auto was_wanted = time_line_.place_in(i, before);
  const double apart = static_cast<double>(was_wanted.tick) - static_cast<double>(at);
  const bool is_lost = std::abs(apart) > kApartTicks * std::max(1.0, double{speed_});
  if (is_moved_ || is_lost || !half.is_playing()) half.seek(wanted.tick);
  const double hurry = is_moved_ ? 0.0 : std::clamp(apart * 1e-3, -kMostHurry, kMostHurry);
  half.set_speed(speed_ * static_cast<float>(1 + hurry));
  half.play();
}

void PairedSource::advance(std::uint64_t now_ns) {
  const std::uint64_t elapsed = now_ns > last_ns_ ? now_ns - last_ns_ : 0;
  last_ns_ = now_ns;
  if (!is_playing_) return;
  exact_ += static_cast<double>(elapsed) * double{speed_} / static_cast<double>(kTickNanoseconds);
  exact_ = std::min(exact_, static_cast<double>(last_tick()));
  position_ = static_cast<Tick>(exact_);
  if (position_ == last_tick()) is_playing_ = false;
}

void PairedSource::poll(replica::MessageSink& sink) {
  read_stories();
  *round_ns_ = clock_();
  if (is_moved_) last_ns_ = *round_ns_;
  const Tick before = position_;
  advance(*round_ns_);
  for (std::size_t i = 0; i < kPair; ++i) steer(i, before);
  is_moved_ = false;
  halves_[0]->poll(sink);
}

void PairedSource::poll_second(replica::MessageSink& sink) {
  halves_[1]->poll(sink);
}

void PairedSource::play() {
  if (is_playing_) return;
  if (position_ == last_tick()) seek(0);
  is_playing_ = true;
}

void PairedSource::seek(Tick tick) {
  position_ = std::min(tick, last_tick());
  exact_ = static_cast<double>(position_);
  is_moved_ = true;
}

void PairedSource::set_speed(float speed) {
  if (!std::isnan(speed)) speed_ = std::clamp(speed, kMinSpeed, kMaxSpeed);
}

}  // namespace trocar::replay
