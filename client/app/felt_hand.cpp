#include "client/app/felt_hand.h"

#include <algorithm>

#include "common/base/log.h"

namespace trocar::app {
namespace {

constexpr std::uint64_t kShortestNs = 3'900'000, kKeepAliveNs = 20'000'000;
constexpr std::size_t kMostRows = 600'000;
constexpr double kDeadBand_m = 60e-6;
constexpr float kDeadTurn = 0.999998f;  // of the cosine of half an angle: 4 mrad

}  // namespace

FeltHand::FeltHand(std::unique_ptr<device::HapticDevice> device, const tool::ToolShape& shape,
                   const haptics::WorkspaceScale& scale, bool has_trace)
    : device_(std::move(device)), shape_(shape), scale_(scale) {
  if (has_trace) trace_ = std::make_unique<haptics::Trace>(kMostRows);
  figures_.device = device_->description();
}

void FeltHand::start(const Vec3d& start_m) {
  haptics::HandSettings settings;
  settings.shape = shape_;
  settings.start_m = start_m;
  settings.scale = scale_;
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
  if (sent_.time_us == 0) return true;
  if (now_ns - sent_ns_ < kShortestNs && reading.verb == sent_.verb) return false;
  const float turn =
      reading.orientation.x * sent_.orientation.x + reading.orientation.y * sent_.orientation.y +
      reading.orientation.z * sent_.orientation.z + reading.orientation.w * sent_.orientation.w;
  const bool rests = length(reading.tip_m - sent_.tip_m) < kDeadBand_m &&
                     std::abs(turn) > kDeadTurn && reading.verb == sent_.verb;
  return !rests || now_ns - sent_ns_ >= kKeepAliveNs;
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
