#include "client/device/gamepad_device.h"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <utility>

#include "client/device/device_checks.h"
#include "common/base/printable.h"

namespace trocar::device {
namespace {

constexpr double kStickDeadZone = 0.12;
constexpr double kFullRumbleN = 2;
// A rumble is renewed after half its time, and changed by steps that a hand can tell apart.
constexpr std::uint16_t kRumbleMs = 200;
constexpr std::uint64_t kRumbleRenewUs = 100'000, kRumbleChangeUs = 40'000;
constexpr double kRumbleStep = 0.05;
// One read() takes no more than this; the rest waits in the kernel, whose buffer is bounded.
constexpr int kMostBatches = 16;

constexpr std::array kButtons{BTN_SOUTH, BTN_EAST, BTN_NORTH,  BTN_WEST,
                              BTN_TL,    BTN_TR,   BTN_SELECT, BTN_START};

// The kernel's bits of what a device has or what is pressed.
template <std::size_t kCount>
struct Bits {
  std::array<std::uint8_t, kCount / 8 + 1> bytes{};

  bool has(std::size_t bit) const { return (bytes[bit / 8] >> (bit % 8) & 1) != 0; }
};

int real_ioctl(int file, unsigned long request, void* argument) {
  return ::ioctl(file, request, argument);
}

bool is_gamepad(int file, const GamepadDevice::Ioctl& ioctl) {
  Bits<KEY_CNT> keys;
  Bits<ABS_CNT> axes;
  return ioctl(file, EVIOCGBIT(EV_KEY, sizeof keys), &keys) >= 0 && keys.has(BTN_GAMEPAD) &&
         ioctl(file, EVIOCGBIT(EV_ABS, sizeof axes), &axes) >= 0 && axes.has(ABS_X) &&
         axes.has(ABS_Y);
}

}  // namespace

double GamepadDevice::Axis::centred() const {
  if (highest <= lowest) return 0;
  return deflection(value - (lowest + highest) / 2, (highest - lowest) / 2, kStickDeadZone);
}

double GamepadDevice::Axis::pressed() const {
  if (highest <= lowest) return 0;
  return std::clamp((value - lowest) / (highest - lowest), 0.0, 1.0);
}

std::vector<std::string> GamepadDevice::find(const std::string& folder) {
  std::vector<std::string> paths;
  std::error_code failure;
  for (const auto& entry : std::filesystem::directory_iterator(folder, failure)) {
    const std::string path = entry.path().string();
    if (!entry.path().filename().string().starts_with("event")) continue;
    const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
    if (file.is_open() && is_gamepad(file.value(), real_ioctl)) paths.push_back(path);
  }
  std::ranges::sort(paths);
  return paths;
}

Result<std::unique_ptr<HapticDevice>> GamepadDevice::open(const std::string& path,
                                                          ClockUs clock_us) {
  FileDescriptor file(::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
  // Rumble needs the right to write, the sticks do not.
  if (!file.is_open() && (errno == EACCES || errno == EROFS))
    file = FileDescriptor(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  if (!file.is_open())
    return Error{ErrorCode::ResourceMissing,
                 printable(path, 200) + ": " + std::strerror(errno) +
                     ", plug the gamepad in, or join the group of the file (usually input)"};
  return adopt(std::move(file), path, real_ioctl, std::move(clock_us));
}

Result<std::unique_ptr<HapticDevice>> GamepadDevice::adopt(FileDescriptor file,
                                                           const std::string& path, Ioctl ioctl,
                                                           ClockUs clock_us) {
  if (!is_gamepad(file.value(), ioctl))
    return Error{ErrorCode::ResourceMissing,
                 printable(path, 200) +
                     ": is no gamepad, choose another one (--list-devices shows those found)"};
  return std::unique_ptr<HapticDevice>(
      new GamepadDevice(std::move(file), path, std::move(ioctl), std::move(clock_us)));
}

GamepadDevice::GamepadDevice(FileDescriptor file, std::string path, Ioctl ioctl, ClockUs clock_us)
    : file_(std::move(file)),
      path_(std::move(path)),
      ioctl_(std::move(ioctl)),
      clock_us_(std::move(clock_us)) {
  std::array<char, 128> name{};
  ioctl_(file_.value(), EVIOCGNAME(name.size() - 1), name.data());
  name_ = printable(name.data(), 60);
  for (Axis& axis : axes_) {
    input_absinfo range{};
    if (ioctl_(file_.value(), EVIOCGABS(axis.code), &range) < 0) continue;
    axis.lowest = range.minimum;
    axis.highest = range.maximum;
  }
  ask_state();
  Bits<FF_CNT> effects;
  effect_.type = FF_RUMBLE;
  effect_.id = -1;  // the kernel chooses one
  effect_.replay.length = kRumbleMs;
  has_rumble_ = ioctl_(file_.value(), EVIOCGBIT(EV_FF, sizeof effects), &effects) >= 0 &&
                effects.has(FF_RUMBLE) && ioctl_(file_.value(), EVIOCSFF, &effect_) >= 0;
}

GamepadDevice::~GamepadDevice() {
  // A rumble that cannot be stopped any more ends by itself.
  if (strength_ > 0) static_cast<void>(rumble(0).ok());
}

Error GamepadDevice::gone() const {
  return {ErrorCode::ResourceMissing,
          printable(path_, 200) + ": the gamepad is gone, plug it in and open it again"};
}

void GamepadDevice::ask_state() {
  for (Axis& axis : axes_) {
    input_absinfo now{};
    if (ioctl_(file_.value(), EVIOCGABS(axis.code), &now) >= 0) axis.value = now.value;
  }
  Bits<KEY_CNT> pressed;
  if (ioctl_(file_.value(), EVIOCGKEY(sizeof pressed), &pressed) < 0) return;
  buttons_ = 0;
  for (std::size_t i = 0; i < kButtons.size(); ++i)
    if (pressed.has(static_cast<std::size_t>(kButtons[i]))) buttons_ |= 1u << i;
}

void GamepadDevice::take(const input_event& event) {
  if (event.type == EV_SYN && event.code == SYN_DROPPED) {
    is_dropped_ = true;
  } else if (event.type == EV_SYN && event.code == SYN_REPORT && is_dropped_) {
    is_dropped_ = false;
    ask_state();
  } else if (is_dropped_) {
    return;
  } else if (event.type == EV_ABS) {
    for (Axis& axis : axes_)
      if (event.code == axis.code) axis.value = event.value;
  } else if (event.type == EV_KEY) {
    for (std::size_t i = 0; i < kButtons.size(); ++i)
      if (event.code == kButtons[i])
        buttons_ = event.value != 0 ? buttons_ | 1u << i : buttons_ & ~(1u << i);
  }
}

Status GamepadDevice::take_events() {
  for (int piece = 0; piece < kMostBatches; ++piece) {
    auto* storage = reinterpret_cast<std::byte*>(events_.data());
    const auto got = ::read(file_.value(), storage + bytes_, sizeof events_ - bytes_);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return {};
    if (got <= 0) return gone();
    bytes_ += static_cast<std::size_t>(got);
    const std::size_t count = bytes_ / sizeof events_[0];
    for (std::size_t i = 0; i < count; ++i) take(events_[i]);
    bytes_ -= count * sizeof events_[0];
    std::memmove(storage, storage + count * sizeof events_[0], bytes_);
  }
  return {};
}

Result<DeviceReading> GamepadDevice::read() {
  if (auto status = take_events(); !status) return status.error();
  const std::uint64_t now_us = clock_us_();
  const auto share = [&](AxisName name) { return axes_[name].centred(); };
  const Vec3d velocity = Vec3d{share(kLeftX), -share(kRightY), share(kLeftY)} * kStickSpeedMS;
  control_.advance(now_us, velocity, {0, -share(kRightX) * kStickTurnRadS, 0});
  DeviceReading reading = control_.reading();
  reading.gripper = static_cast<float>(axes_[kTrigger].pressed());
  reading.buttons = buttons_;
  reading.time_us = now_us;
  return reading;
}

Status GamepadDevice::rumble(double strength) {
  input_event play{};
  play.type = EV_FF;
  play.value = strength > 0 ? 1 : 0;
  effect_.u.rumble.strong_magnitude = static_cast<std::uint16_t>(strength * 0xffff);
  effect_.u.rumble.weak_magnitude = effect_.u.rumble.strong_magnitude;
  rumble_us_ = clock_us_();
  if (strength > 0 && ioctl_(file_.value(), EVIOCSFF, &effect_) < 0)
    return errno == ENODEV ? Status{gone()} : Status{};
  strength_ = strength;
  play.code = static_cast<std::uint16_t>(effect_.id);
  const auto sent = ::write(file_.value(), &play, sizeof play);
  return sent < 0 && errno != EAGAIN && errno != EINTR ? Status{gone()} : Status{};
}

Status GamepadDevice::write(const Vec3d& force_n, const Vec3d&) {
  if (!has_rumble_) return {};
  const double strength = length(checked_force(force_n, kFullRumbleN)) / kFullRumbleN;
  const double stepped = std::round(strength / kRumbleStep) * kRumbleStep;
  const std::uint64_t since_us = clock_us_() - rumble_us_;
  const bool is_changed = stepped != strength_ && (stepped == 0 || since_us >= kRumbleChangeUs);
  const bool is_due = stepped > 0 && since_us >= kRumbleRenewUs;
  return is_changed || is_due ? rumble(stepped) : Status{};
}

DeviceLimits GamepadDevice::limits() const {
  return {.force_n = has_rumble_ ? kFullRumbleN : 0,
          .rate_hz = 125,
          .workspace_m = {kStickReachM, kStickReachM, kStickReachM}};
}

std::string GamepadDevice::description() const {
  return "gamepad " + name_ + (has_rumble_ ? " with rumble" : "");
}

}  // namespace trocar::device
