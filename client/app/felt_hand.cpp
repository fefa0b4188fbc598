#include "client/app/felt_hand.h"

#include <fmt/format.h>

#include <algorithm>

#include "client/haptics/fulcrum.h"
#include "client/haptics/reading_pace.h"
#include "common/base/log.h"

namespace trocar::app {
namespace {

Status check_port(const haptics::HandSettings& settings) {
  if (!settings.port_m) return {};
  const Vec3d& start = settings.start_m;
  const auto length_m = static_cast<double>(settings.shape.length_m);
  if (haptics::Fulcrum(*settings.port_m, start, length_m).is_in_reach()) return {};
  return Error{ErrorCode::Usage,
               fmt::format("--port: is {:.0f} mm from where the tool begins ({:.0f},{:.0f},{:.0f} "
                           "mm), and its shaft reaches {:.0f} to {:.0f} mm; move it",
                           1e3 * length(*settings.port_m - start), 1e3 * start.x, 1e3 * start.y,
                           1e3 * start.z, 1e3 * haptics::Fulcrum::kLeastInside_m,
                           1e3 * (length_m - haptics::Fulcrum::kLeastOutside_m))};
}

}  // namespace

FeltHand::FeltHand(std::unique_ptr<device::HapticDevice> device, const FeltSettings& settings)
    : device_(std::move(device)), settings_(settings) {
  if (const auto own = device_->own_tool()) {
    settings_ = {.has_trace = settings.has_trace};
    settings_.tool.shape = own->shape;
  }
  if (settings_.has_trace) trace_ = std::make_unique<haptics::Trace>(kMostTraceRows);
  figures_.device = device_->description();
}

Status FeltHand::start(const Vec3d& start_m) {
  const auto own = device_->own_tool();
  haptics::HandSettings settings;
  settings.shape = settings_.tool.shape;
  settings.gripper_verb = settings_.tool.gripper_verb;
  settings.button_verb = settings_.tool.button_verb;
  settings.start_m = own ? own->start_m : start_m;
  settings.port_m = settings_.port_m;
  settings.scale = settings_.scale;
  if (const auto reached = check_port(settings); !reached) return reached;
  hand_ = std::make_unique<haptics::Hand>(*device_, settings, trace_.get());
  for (const auto& law : early_laws_) hand_->put(law);
  early_laws_.clear();
  loop_ = std::make_unique<haptics::Loop>(*hand_, haptics::LoopSettings{});
  const auto granted = loop_->start();
  figures_.has_priority = granted.has_priority;
  figures_.has_locked_memory = granted.has_locked_memory;
  log::info("{}: 1000 times a second{}", figures_.device,
            granted.has_priority
                ? ""
                : ", without real-time priority: forces may stutter while the machine is busy "
                  "(allow it with the limits rtprio and memlock)");
  return {};
}

void FeltHand::take(const wire::HapticLaw& law) {
  if (!hand_) {
    early_laws_.push_back(law);
  } else if (!hand_->put(law)) {
    log::warn("{}: too many materials at once", figures_.device);
  }
}

void FeltHand::take(const wire::HapticPatch& patch) {
  if (!hand_) return;
  hand_->put(patch);
  figures_.largest_server_force_n =
      std::max(figures_.largest_server_force_n, length(to_double(patch.force_n)));
}

bool FeltHand::is_due(const haptics::HandReading& reading, std::uint64_t now_ns) const {
  return sent_.time_us == 0 || haptics::is_due(reading, sent_, now_ns - sent_ns_);
}

Result<std::optional<haptics::HandReading>> FeltHand::pop_due(std::uint64_t now_ns) {
  using Due = std::optional<haptics::HandReading>;
  if (!loop_) return Due{};
  if (!loop_->is_running() && loop_->failure())
    return Error{ErrorCode::ResourceMissing, figures_.device + ": " + loop_->failure()->message};
  hand_->take_reading(reading_);
  if (reading_.time_us == 0 || reading_.time_us == sent_.time_us || !is_due(reading_, now_ns))
    return Due{};
  sent_ = reading_;
  sent_ns_ = now_ns;
  ++figures_.readings_sent;
  return Due{reading_};
}

const FeltFigures& FeltHand::figures() {
  if (!loop_) return figures_;
  loop_->take_timing(figures_.timing);
  if (hand_->take_state(figures_.state))
    figures_.largest_force_n =
        std::max(figures_.largest_force_n, length(figures_.state.hand_force_n));
  return figures_;
}

const haptics::Trace* FeltHand::stop() {
  if (loop_) loop_->stop();
  if (trace_ && trace_->is_full())
    log::warn("{}: the trace holds the first ten minutes only", figures_.device);
  return trace_.get();
}

}  // namespace trocar::app
