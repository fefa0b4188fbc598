#include "client/app/felt_replay.h"

#include <utility>

#include "common/base/log.h"

namespace trocar::app {

FeltReplay::FeltReplay(std::unique_ptr<device::HapticDevice> device, replay::RecordedHand hand,
                       const haptics::PlaybackSettings& settings, bool has_trace)
    : device_(std::move(device)),
      name_(hand.name),
      trace_(has_trace ? std::make_unique<haptics::Trace>(kMostTraceRows) : nullptr),
      hand_(*device_, std::move(hand), settings, trace_.get()),
      loop_(hand_, {}) {
  figures_.device = device_->description();
  figures_.scale = settings.scale;
}

Status FeltReplay::update(const replica::PlaybackControl& playback, std::uint64_t now_ns) {
  if (!is_started_) {
    is_started_ = true;
    const auto granted = loop_.start();
    figures_.has_priority = granted.has_priority;
    figures_.has_locked_memory = granted.has_locked_memory;
    log::info("{} feels what {} felt", figures_.device, name_);
  }
  if (!loop_.is_running() && loop_.failure())
    return Error{loop_.failure()->code, figures_.device + ": " + loop_.failure()->message};
  const bool has_more = playback.position() < playback.last_tick();
  hand_.put({.tick = static_cast<double>(playback.position()),
             .time_us = now_ns / 1000,
             .is_running = playback.is_playing() && playback.speed() == 1.0f && has_more});
  figures();
  return {};
}

const FeltFigures& FeltReplay::figures() {
  loop_.take_timing(figures_.timing);
  hand_.take_state(figures_.state);
  return figures_;
}

const haptics::Trace* FeltReplay::stop() {
  loop_.stop();
  return trace_.get();
}

}  // namespace trocar::app
