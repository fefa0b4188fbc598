#include "client/app/felt_hand.h"

#include <algorithm>

#include "common/base/log.h"

namespace trocar::app {
namespace {

constexpr std::uint64_t kShortestNs = 2'000'000;  // the network asks every 4 ms, now and then late
constexpr std::uint64_t kKeepAliveNs = 20'000'000;
constexpr std::size_t kMostLaws = 8;  // that wait: a model keeps no more
constexpr std::uint64_t kPublishEvery = 16;
constexpr std::size_t kMostRows = 600'000;
constexpr double kDeadBand_m = 60e-6;
constexpr float kDeadTurn = 0.999998f;  // of the cosine of half an angle: 4 mrad

}  // namespace

FeltHand::FeltHand(std::unique_ptr<device::HapticDevice> device, const tool::ToolShape& shape,
                   const haptics::WorkspaceScale& scale, bool has_trace)
    : device_(std::move(device)),
      shape_(shape),
      scale_(scale),
      reporter_(device_->description(), scale) {
  if (has_trace) trace_ = std::make_unique<haptics::Trace>(kMostRows);
  figures_.device = device_->description();
  figures_.scale = scale_;
}

void FeltHand::start(const Vec3d& start_m) {
  haptics::HandSettings settings;
  settings.shape = shape_;
  settings.start_m = start_m;
  settings.scale = scale_;
  hand_ = std::make_unique<haptics::Hand>(*device_, settings, trace_.get());
  hand_->put_view(view_);
  loop_ = std::make_unique<haptics::Loop>(*hand_, haptics::LoopSettings{});
  const auto granted = loop_->start();
  figures_.has_priority = granted.has_priority;
  figures_.has_locked_memory = granted.has_locked_memory;
  is_live_.store(true, std::memory_order_release);
  log::info("{}: 1000 times a second{}", figures_.device,
            granted.has_priority
                ? ""
                : ", without real-time priority: forces may stutter while the machine is busy "
                  "(allow it with the limits rtprio and memlock)");
}

void FeltHand::set_view(const Quatf& world_from_device) {
  if (world_from_device == view_) return;
  view_ = world_from_device;
  if (hand_) hand_->put_view(view_);
}

Status FeltHand::check() const {
  if (!loop_ || loop_->is_running() || !loop_->failure()) return {};
  return Error{ErrorCode::ResourceMissing, figures_.device + ": " + loop_->failure()->message};
}

const FeltFigures& FeltHand::figures() {
  if (!loop_) return figures_;
  loop_->take_timing(figures_.timing);
  hand_->take_state(figures_.state);
  const SendTimes& times = send_times_.newest();
  figures_.readings_sent = times.count;
  figures_.sent_median_ms = times.median_us * 1e-3;
  figures_.sent_99_ms = times.most_us * 1e-3;
  return figures_;
}

const haptics::Trace* FeltHand::stop() {
  if (loop_) loop_->stop();
  if (trace_ && trace_->is_full())
    log::warn("{}: the trace holds the first ten minutes only", figures_.device);
  return trace_.get();
}

// ---- network's thread ----

void FeltHand::take(const wire::HapticLaw& law) {
  if (waiting_laws_.size() == kMostLaws) waiting_laws_.erase(waiting_laws_.begin());
  waiting_laws_.push_back(law);
  if (is_live_.load(std::memory_order_acquire)) pass_on_laws();
}

// The loop takes them within a millisecond; what does not fit waits for the next time.
void FeltHand::pass_on_laws() {
  auto next = waiting_laws_.begin();
  while (next != waiting_laws_.end() && hand_->put(*next)) ++next;
  waiting_laws_.erase(waiting_laws_.begin(), next);
}

void FeltHand::take(const wire::HapticPatch& patch) {
  if (is_live_.load(std::memory_order_acquire)) hand_->put(patch);
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

std::optional<haptics::HandReading> FeltHand::pop_reading(std::uint64_t now_ns) {
  if (!is_live_.load(std::memory_order_acquire)) return std::nullopt;
  pass_on_laws();
  hand_->take_reading(reading_);
  if (reading_.time_us == 0 || reading_.time_us == sent_.time_us || !is_due(reading_, now_ns))
    return std::nullopt;
  note_sent(now_ns);
  return reading_;
}

std::optional<wire::HandReport> FeltHand::pop_report() {
  haptics::HandState state;
  const bool is_new = is_live_.load(std::memory_order_acquire) && hand_->take_report(state);
  return is_new ? reporter_.add(state) : std::nullopt;
}

void FeltHand::note_sent(std::uint64_t now_ns) {
  if (sent_ns_ != 0) intervals_.add(static_cast<double>(now_ns - sent_ns_) * 1e-3);
  sent_ = reading_;
  sent_ns_ = now_ns;
  sent_places_.try_push({to_float(reading_.tip_m), now_ns});
  if (times_.count++ % kPublishEvery == 0) {
    times_.median_us = intervals_.quantile_us(0.5);
    times_.most_us = intervals_.quantile_us(0.99);
  }
  send_times_.put(times_);
}

}  // namespace trocar::app
