#include "server/session/control/blade_waits.h"

#include <algorithm>

#include "server/tissue/step/simulation.h"

namespace trocar::control {
namespace {

constexpr float kSpeedGain = 1.0f / 32;
constexpr double kMeanLoadGain = 1.0 / 64;
constexpr double kMostLoad = kTicksPerFrame;  // A stall says nothing about blades, however long.

}  // namespace

void BladeWaits::observe(std::span<const float, kMaxTools> speeds_m_s, double load) {
  ++now_;
  load_ += kMeanLoadGain * (std::min(load, kMostLoad) - load_);
  for (std::size_t i = 0; i < kMaxTools; ++i) {
    auto& blade = blades_[i];
    blade.speed_m_s += kSpeedGain * (speeds_m_s[i] - blade.speed_m_s);
    if (load_ > kHighLoad && blade.speed_m_s > kOrdinary_m_s && !blade.waits) begin(blade);
  }
  if (now_ >= released_ + kReleaseEvery) release_one();
}

void BladeWaits::begin(Blade& blade) const {
  const bool is_again = blade.ended > 0 && now_ < blade.ended + kForget;
  blade = {
      .since = now_, .wait = is_again ? kWaitAgain : kWait, .ended = blade.ended, .waits = true};
}

bool BladeWaits::may_go_on(const Blade& blade) const {
  const Tick waited = now_ - blade.since;
  return blade.waits && (waited >= kMostWait || (waited >= blade.wait && load_ < kLowLoad));
}

void BladeWaits::release_one() {
  Blade* first = nullptr;
  for (auto& blade : blades_)
    if (may_go_on(blade) && (first == nullptr || blade.since < first->since)) first = &blade;
  if (first == nullptr) return;
  first->waits = false;
  first->ended = released_ = now_;
}

std::uint32_t BladeWaits::waiting() const {
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < kMaxTools; ++i) bits |= std::uint32_t{blades_[i].waits} << i;
  return bits;
}

std::uint32_t BladeWaits::waited_lately() const {
  auto bits = waiting();
  for (std::size_t i = 0; i < kMaxTools; ++i)
    if (blades_[i].ended > 0 && now_ < blades_[i].ended + kTicksPerSecond) bits |= 1u << i;
  return bits;
}

std::array<float, kMaxTools> read_cutting_speeds(const step::Simulation& simulation) {
  std::array<float, kMaxTools> speeds_m_s{};
  for (std::uint8_t i = 0; i < kMaxTools; ++i)
    speeds_m_s[i] = simulation.state().cuts.cutting_speed_m_s(ToolSlot{i});
  return speeds_m_s;
}

}  // namespace trocar::control
