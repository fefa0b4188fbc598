#include "client/device/journal_device.h"

#include <utility>

namespace trocar::device {
namespace {

constexpr double kTick_us = 1e-3 * static_cast<double>(kTickNanoseconds);
constexpr double kJournalReach_m = 2;  // as far as a tool may be

}  // namespace

JournalDevice::JournalDevice(replay::RecordedHand hand, ClockUs clock_us)
    : hand_(std::move(hand)), clock_us_(std::move(clock_us)) {}

Result<DeviceReading> JournalDevice::read() {
  const std::uint64_t now_us = clock_us_();
  if (start_us_ == 0) start_us_ = now_us;
  const double tick = static_cast<double>(hand_.samples.front().tick) +
                      static_cast<double>(now_us - start_us_) / kTick_us;
  const auto sample = hand_.sample_at(tick);
  const bool is_over = tick > static_cast<double>(hand_.samples.back().tick);
  const auto verb = is_over ? tool::Verb::None : sample.verb;
  DeviceReading reading;
  reading.position_m = to_double(sample.world_from_tool.position);
  reading.orientation = sample.world_from_tool.orientation;
  reading.gripper = verb == tool::Verb::Grasp ? 1.0f : 0.0f;
  if (verb == tool::Verb::Cut) reading.buttons = 2;
  if (verb == tool::Verb::None) reading.buttons = kRestsButton;
  const auto before = hand_.sample_at(tick - 1).world_from_tool.position;
  reading.velocity_m_s = (reading.position_m - to_double(before)) / (kTick_us * 1e-6);
  reading.time_us = now_us;
  return reading;
}

DeviceLimits JournalDevice::limits() const {
  return {.rate_hz = 1000, .workspace_m = {kJournalReach_m, kJournalReach_m, kJournalReach_m}};
}

std::string JournalDevice::description() const {
  return "recorded hand of " + hand_.name;
}

std::optional<OwnTool> JournalDevice::own_tool() const {
  return OwnTool{hand_.shape, to_double(hand_.samples.front().world_from_tool.position)};
}

}  // namespace trocar::device
