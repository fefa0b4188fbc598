#include "client/app/felt_hand.h"

#include <fmt/format.h>

#include <algorithm>

#include "client/haptics/fulcrum.h"
#include "client/haptics/reading_pace.h"
#include "common/base/log.h"

namespace trocar::app {
namespace {

constexpr std::size_t kMostLaws = 8;  // that wait: a model keeps no more
constexpr std::uint64_t kPublishEvery = 16;
constexpr std::uint64_t kJudgedSteps = 1000;
// The network asks every 4 ms, now and then a little early.
constexpr haptics::ReadingPace kPace{.shortest_ns = 2'000'000};

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

FeltSettings settings_for(const device::HapticDevice& device, const FeltSettings& wanted) {
  const auto own = device.own_tool();
  if (!own) return wanted;
  FeltSettings settings{.has_trace = wanted.has_trace};
  settings.tool.shape = own->shape;
  return settings;
}

}  // namespace

FeltHand::FeltHand(std::unique_ptr<device::HapticDevice> device, const FeltSettings& settings)
    : device_(std::move(device)),
      settings_(settings_for(*device_, settings)),
      reporter_(device_->description(), settings_.scale) {
  if (settings_.has_trace) trace_ = std::make_unique<haptics::Trace>(kMostTraceRows);
  figures_.device = device_->description();
  figures_.scale = settings_.scale;
}

Status FeltHand::start(const Vec3d& start_m) {
  const auto own = device_->own_tool();
  haptics::HandSettings settings;
  settings.shape = settings_.tool.shape;
  settings.gripper_verb = settings_.tool.grip_verb();
  settings.button_verb = settings_.tool.button_verb();
  settings.start_m = own ? own->start_m : start_m;
  settings.port_m = settings_.port_m;
  settings.scale = settings_.scale;
  if (const auto reached = check_port(settings); !reached) return reached;
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
  return {};
}

void FeltHand::set_view(const Quatf& world_from_device) {
  if (world_from_device == view_ || device_->own_tool()) return;
  view_ = world_from_device;
  if (hand_) hand_->put_view(view_);
}

Status FeltHand::check() {
  if (!loop_) return {};
  judge_readings();
  if (loop_->is_running() || !loop_->failure()) return {};
  return Error{ErrorCode::ResourceMissing, figures_.device + ": " + loop_->failure()->message};
}

// The safety chain takes the force away without a word, so somebody has to say it.
void FeltHand::judge_readings() {
  hand_->take_state(figures_.state);
  const auto& state = figures_.state;
  const auto steps = state.steps - judged_steps_;
  if (steps < kJudgedSteps) return;
  const auto old = state.limit_counts[static_cast<std::size_t>(haptics::Limit::StaleReading)];
  const bool is_late = 2 * (old - judged_old_) > steps;
  judged_steps_ = state.steps;
  judged_old_ = old;
  if (is_late && !has_old_readings_)
    log::warn(
        "{}: its readings are more than 20 ms old, so the hand feels nothing; see to its cable and "
        "its driver, or end other programs",
        figures_.device);
  has_old_readings_ = is_late;
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
  return sent_.time_us == 0 || haptics::is_due(reading, sent_, now_ns - sent_ns_, kPace);
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
