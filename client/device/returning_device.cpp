#include "client/device/returning_device.h"

#include <chrono>
#include <utility>

#include "common/base/log.h"

namespace trocar::device {
namespace {

constexpr std::chrono::seconds kSearchPause{1};
// How long it takes until a loss is noticed: the loop that loses a device cannot wait for a lock.
constexpr std::chrono::milliseconds kLookPause{100};

}  // namespace

Result<std::unique_ptr<HapticDevice>> ReturningDevice::open(Open open) {
  auto device = open();
  if (!device) return device.error();
  return std::unique_ptr<HapticDevice>(new ReturningDevice(std::move(*device), std::move(open)));
}

ReturningDevice::ReturningDevice(std::unique_ptr<HapticDevice> device, Open open)
    : open_(std::move(open)),
      limits_(device->limits()),
      own_tool_(device->own_tool()),
      description_(device->description()),
      device_(std::move(device)),
      thread_([this](const std::stop_token& stop) { search(stop); }) {}

ReturningDevice::~ReturningDevice() {
  thread_.request_stop();
  thread_.join();
  delete lost_.load();
  delete found_.load();
}

// The thread has taken the one before, because it has found this one since.
DeviceReading ReturningDevice::lose(Error why) {
  why_ = std::move(why);
  lost_.store(device_.release(), std::memory_order_release);
  last_.buttons = kRestsButton;
  return last_;
}

Result<DeviceReading> ReturningDevice::read() {
  if (!device_) {
    device_.reset(found_.exchange(nullptr, std::memory_order_acquire));
    if (!device_) return last_;
    is_back_ = true;
  }
  auto reading = device_->read();
  if (!reading) return lose(reading.error());
  // A device may say nothing at first: then its time is 0.
  if (is_back_ && reading->time_us == 0) return last_;
  last_ = *reading;
  if (std::exchange(is_back_, false)) reading->buttons |= kLetGoButton;
  return reading;
}

Status ReturningDevice::write(const Vec3d& force_n, const Vec3d& torque_nm) {
  if (!device_) return {};
  if (auto written = device_->write(force_n, torque_nm); !written) lose(written.error());
  return {};
}

void ReturningDevice::search(const std::stop_token& stop) {
  const auto pause = [&](auto time) {
    std::unique_lock lock(mutex_);
    wake_.wait_for(lock, stop, time, [] { return false; });
  };
  for (; !stop.stop_requested(); pause(kLookPause)) {
    const std::unique_ptr<HapticDevice> lost(lost_.exchange(nullptr, std::memory_order_acquire));
    if (!lost) continue;
    log::warn("{} is gone: {}; its tool rests until it is back", description_, why_.message);
    while (!stop.stop_requested()) {
      pause(kSearchPause);
      auto found = open_();
      if (!found) continue;
      log::info("{} is back", description_);
      found_.store(found->release(), std::memory_order_release);
      break;
    }
  }
}

}  // namespace trocar::device
