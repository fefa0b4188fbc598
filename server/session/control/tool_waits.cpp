#include "server/session/control/tool_waits.h"

#include <algorithm>

#include "server/tissue/step/simulation.h"

namespace trocar::control {
namespace {

constexpr float kSpeedGain = 1.0f / 32;
constexpr double kMeanLoadGain = 1.0 / 64;
constexpr float kMostSpeed_m_s = 1;           // A hand that appears elsewhere counts for little.
constexpr double kMostLoad = kTicksPerFrame;  // A stall says nothing about tools, however long.

}  // namespace

void ToolWaits::observe(std::span<const float, kMaxTools> speeds_m_s, double load) {
  ++now_;
  load_ += kMeanLoadGain * (std::min(load, kMostLoad) - load_);
  for (std::size_t i = 0; i < kMaxTools; ++i) {
    auto& tool = tools_[i];
    tool.speed_m_s += kSpeedGain * (speeds_m_s[i] - tool.speed_m_s);
    if (load_ > kHighLoad && tool.speed_m_s > kOrdinary_m_s && !tool.waits) begin(tool);
  }
  if (now_ >= released_ + kReleaseEvery) release_one();
}

void ToolWaits::begin(ToolWait& tool) const {
  const bool is_again = tool.ended > 0 && now_ < tool.ended + kForget;
  tool = {.since = now_, .wait = is_again ? kWaitAgain : kWait, .ended = tool.ended, .waits = true};
}

bool ToolWaits::may_go_on(const ToolWait& tool) const {
  const Tick waited = now_ - tool.since;
  return tool.waits && (waited >= kMostWait || (waited >= tool.wait && load_ < kLowLoad));
}

void ToolWaits::release_one() {
  ToolWait* first = nullptr;
  for (auto& tool : tools_)
    if (may_go_on(tool) && (first == nullptr || tool.since < first->since)) first = &tool;
  if (first == nullptr) return;
  first->waits = false;
  first->ended = released_ = now_;
}

std::uint32_t ToolWaits::waiting() const {
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < kMaxTools; ++i) bits |= std::uint32_t{tools_[i].waits} << i;
  return bits;
}

std::uint32_t ToolWaits::waited_lately() const {
  auto bits = waiting();
  for (std::size_t i = 0; i < kMaxTools; ++i)
    if (tools_[i].ended > 0 && now_ < tools_[i].ended + kTicksPerSecond) bits |= 1u << i;
  return bits;
}

std::array<float, kMaxTools> TissueSpeeds::read(const step::Simulation& simulation) {
  const auto& state = simulation.state();
  std::array<float, kMaxTools> speeds_m_s{};
  std::array<bool, kMaxTools> touches{};
  for (const auto& contact : simulation.context().contact.found.tools) {
    const bool holds = contact.verb == tool::Verb::Grasp && !state.grasps[contact.tool].is_anchored;
    touches[contact.tool.value] = holds || state.proxies[contact.tool].presses();
  }
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const Vec3f tip = state.tools[ToolSlot{i}].pose.position;
    const float hand_m_s = length(tip - tips_[i]) / kTickSeconds;
    tips_[i] = tip;
    const float speed = touches[i] ? hand_m_s : state.cuts.cutting_speed_m_s(ToolSlot{i});
    speeds_m_s[i] = std::min(speed, kMostSpeed_m_s);
  }
  return speeds_m_s;
}

}  // namespace trocar::control
