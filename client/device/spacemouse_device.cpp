#include "client/device/spacemouse_device.h"

#include <sys/socket.h>
#include <sys/un.h>

#include <cerrno>
#include <cstring>
#include <span>
#include <utility>

#include "client/device/device_checks.h"

namespace trocar::device {
namespace {

enum EventType : std::int32_t { kMotion = 0, kPress = 1, kRelease = 2, kDeviceChange = 3 };
constexpr std::int32_t kDeviceRemoved = 1;
// The upper half of a word marks that it is no event; the daemon answers with the word it got.
constexpr std::uint32_t kTag = 0x7faa0000, kTagMask = 0xffff0000;
constexpr std::uint32_t kAskForProtocol1 = kTag | 0x5500 | 1;

constexpr double kFullCounts = 350, kCapDeadZone = 0.04;
constexpr std::uint64_t kSilenceUs = 100'000;
// One read() takes no more than this; the rest waits in the socket, whose buffer is bounded.
constexpr int kMostReads = 256;

Error unreachable(const std::string& path, const std::string& why) {
  return {
      ErrorCode::ResourceMissing,
      path + ": " + why +
          ", install spacenavd and start it (apt install spacenavd; systemctl start spacenavd)"};
}

}  // namespace

SpaceMouseDevice::SpaceMouseDevice(FileDescriptor socket, ClockUs clock_us)
    : socket_(std::move(socket)), clock_us_(std::move(clock_us)) {}

Result<std::unique_ptr<HapticDevice>> SpaceMouseDevice::open(const std::string& socket_path,
                                                             ClockUs clock_us) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (socket_path.empty() || socket_path.size() >= sizeof address.sun_path)
    return Error{ErrorCode::Usage,
                 "the path of the socket of spacenavd is empty or too long, "
                 "write for example spacemouse:/var/run/spnav.sock"};
  std::memcpy(address.sun_path, socket_path.data(), socket_path.size());
  FileDescriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!socket.is_open()) return unreachable(socket_path, std::strerror(errno));
  if (connect(socket.value(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return unreachable(socket_path, std::strerror(errno));
  const std::uint32_t question = kAskForProtocol1;
  if (send(socket.value(), &question, sizeof question, MSG_NOSIGNAL) != sizeof question)
    return unreachable(socket_path, std::strerror(errno));
  return std::unique_ptr<HapticDevice>(
      new SpaceMouseDevice(std::move(socket), std::move(clock_us)));
}

void SpaceMouseDevice::take(const Event& event, std::uint64_t now_us) {
  if (event[0] == kMotion) {
    const auto share = [&](std::size_t i) {
      return deflection(event[i], kFullCounts, kCapDeadZone);
    };
    velocity_m_s_ = Vec3d{share(1), share(2), -share(3)} * kStickSpeedMS;
    turn_rad_s_ = Vec3d{share(4), share(5), -share(6)} * kStickTurnRadS;
    last_event_us_ = now_us;
  } else if (event[0] == kPress || event[0] == kRelease) {
    if (event[1] < 0 || event[1] >= 32) return;
    const std::uint32_t bit = 1u << event[1];
    buttons_ = event[0] == kPress ? buttons_ | bit : buttons_ & ~bit;
  } else if (event[0] == kDeviceChange) {
    is_plugged_ = event[1] != kDeviceRemoved;
    velocity_m_s_ = turn_rad_s_ = {};
    buttons_ = 0;
  }
}

Status SpaceMouseDevice::take_bytes() {
  for (int piece = 0; piece < kMostReads; ++piece) {
    // An event is read word by word at first: the daemon's answer is one word and no event.
    const std::size_t wanted =
        bytes_ < sizeof event_[0] ? sizeof event_[0] - bytes_ : sizeof event_ - bytes_;
    const auto storage = std::as_writable_bytes(std::span(event_)).subspan(bytes_, wanted);
    const auto got = recv(socket_.value(), storage.data(), storage.size(), MSG_DONTWAIT);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return {};
    if (got <= 0)
      return Error{ErrorCode::ResourceMissing,
                   "spacenavd closed the connection, start it again (systemctl start spacenavd)"};
    bytes_ += static_cast<std::size_t>(got);
    const bool is_word = bytes_ == sizeof event_[0];
    if (is_word && (static_cast<std::uint32_t>(event_[0]) & kTagMask) == kTag) bytes_ = 0;
    if (bytes_ < sizeof event_) continue;
    bytes_ = 0;
    take(event_, clock_us_());
  }
  return {};
}

Result<DeviceReading> SpaceMouseDevice::read() {
  if (auto status = take_bytes(); !status) return status.error();
  if (!is_plugged_)
    return Error{ErrorCode::ResourceMissing, "the 3D mouse was unplugged, plug it in again"};
  const std::uint64_t now_us = clock_us_();
  const bool is_deflected = velocity_m_s_ != Vec3d{} || turn_rad_s_ != Vec3d{};
  const bool is_stuck = is_deflected && now_us > last_event_us_ + kSilenceUs;
  if (is_stuck)
    control_.advance(now_us, {}, {});
  else
    control_.advance(now_us, velocity_m_s_, turn_rad_s_);
  DeviceReading reading = control_.reading();
  reading.buttons = buttons_;
  reading.time_us = is_stuck ? last_event_us_ + kSilenceUs : now_us;
  return reading;
}

Status SpaceMouseDevice::write(const Vec3d&, const Vec3d&) {
  return {};
}

DeviceLimits SpaceMouseDevice::limits() const {
  return {.rate_hz = 125, .workspace_m = {kStickReachM, kStickReachM, kStickReachM}};
}

std::string SpaceMouseDevice::description() const {
  return "3D mouse through spacenavd";
}

}  // namespace trocar::device
