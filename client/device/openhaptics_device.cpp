#include "client/device/openhaptics_device.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>
#include <utility>

#include "client/device/device_checks.h"
#include "client/device/device_exchange.h"
#include "client/device/shared_object.h"
#include "common/base/printable.h"

namespace trocar::device {
namespace {

constexpr const char* kHdAdvice =
    "install OpenHaptics and the Touch driver (3dsystems.com) and run its setup program";
constexpr unsigned kNoDevice = 0xffffffff;
constexpr unsigned short kHdPriority = 0x7fff;       // the library's default
constexpr unsigned kCallAgain = 1, kCallNoMore = 0;  // what a callback returns
constexpr std::chrono::milliseconds kHdFarewell{1000};

enum Parameter : unsigned {
  kButtonState = 0x2000,
  kPosition = 0x2050,   // 3, mm
  kVelocity = 0x2051,   // 3, mm/s
  kTransform = 0x2052,  // 16, by columns, mm
  kModel = 0x2501,
  kUsableWorkspace = 0x2551,  // 6, mm: lower and upper corner
  kMaxStiffness = 0x2602,     // N/mm
  kMaxForce = 0x2603,         // N
  kForce = 0x2700,            // 3, N
  kForceOutput = 0x4000,
};

Vec3d metres(const double* mm) {
  return Vec3d{mm[0], mm[1], mm[2]} * 1e-3;
}

}  // namespace

// Functions of libHD 3.
struct OpenHapticsDevice::Library {
  // The library's error is a struct of three 32-bit numbers. Some bindings read a 16-bit code, so
  // only those bits count; all codes fit.
  struct Failure {
    unsigned code;
    int internal;
    unsigned device;

    unsigned short_code() const { return code & 0xffff; }
    // Warm motors, or too much force: the library limits or stops the force, and goes on reading.
    bool is_of_force() const { return (short_code() & 0xff00) == 0x0200; }
  };

  unsigned (*init_device)(const char*) = nullptr;
  void (*disable_device)(unsigned) = nullptr;
  void (*make_current_device)(unsigned) = nullptr;
  void (*enable)(unsigned) = nullptr;
  unsigned long (*schedule_asynchronous)(unsigned (*)(void*), void*, unsigned short) = nullptr;
  void (*unschedule)(unsigned long) = nullptr;
  void (*start_scheduler)() = nullptr;
  void (*stop_scheduler)() = nullptr;
  void (*begin_frame)(unsigned) = nullptr;
  void (*end_frame)(unsigned) = nullptr;
  void (*get_doublev)(unsigned, double*) = nullptr;
  void (*get_integerv)(unsigned, int*) = nullptr;
  void (*set_doublev)(unsigned, const double*) = nullptr;
  const char* (*get_string)(unsigned) = nullptr;
  Failure (*get_error)() = nullptr;
  const char* (*get_error_string)(unsigned) = nullptr;

  std::string text_of(const Failure& error) const {
    const char* text = get_error_string(error.short_code());
    return printable(text == nullptr ? "no reason" : text, 200);
  }
  // Errors wait in a queue; at most this many are taken.
  void forget_errors() const {
    for (int i = 0; i < 100 && get_error().short_code() != 0; ++i) {
    }
  }
  // Returns a value of the device, or `otherwise` if it is not within (0, most].
  double positive(unsigned parameter, double most, double otherwise) const {
    double value[16]{};
    get_doublev(parameter, value);
    return value[0] > 0 && value[0] <= most ? value[0] : otherwise;
  }
};

Result<OpenHapticsDevice::Library> OpenHapticsDevice::load(const std::vector<std::string>& names) {
  auto library = SharedObject::open(names, kHdAdvice);
  if (!library) return library.error();
  Library hd;
  library->bind("hdInitDevice", hd.init_device);
  library->bind("hdDisableDevice", hd.disable_device);
  library->bind("hdMakeCurrentDevice", hd.make_current_device);
  library->bind("hdEnable", hd.enable);
  library->bind("hdScheduleAsynchronous", hd.schedule_asynchronous);
  library->bind("hdUnschedule", hd.unschedule);
  library->bind("hdStartScheduler", hd.start_scheduler);
  library->bind("hdStopScheduler", hd.stop_scheduler);
  library->bind("hdBeginFrame", hd.begin_frame);
  library->bind("hdEndFrame", hd.end_frame);
  library->bind("hdGetDoublev", hd.get_doublev);
  library->bind("hdGetIntegerv", hd.get_integerv);
  library->bind("hdSetDoublev", hd.set_doublev);
  library->bind("hdGetString", hd.get_string);
  library->bind("hdGetError", hd.get_error);
  library->bind("hdGetErrorString", hd.get_error_string);
  if (auto status = library->check(); !status) return status.error();
  return hd;
}

class OpenHapticsDevice::Servo {
 public:
  Servo(const Library& hd, unsigned device) : hd_(hd), device_(device) {
    const char* model = hd.get_string(kModel);
    name = printable(model == nullptr ? "haptic device" : model, 60);
    limits.force_n = hd.positive(kMaxForce, 50, 3);
    limits.stiffness_n_m = 1000 * hd.positive(kMaxStiffness, 10, 0.5);
    limits.rate_hz = 1000;
    double corners[16]{};
    hd.get_doublev(kUsableWorkspace, corners);
    const Vec3d half = (metres(corners + 3) - metres(corners)) / 2;
    const bool is_box = half.x > 0 && half.y > 0 && half.z > 0 && length(half) <= kFarthestM;
    limits.workspace_m = is_box ? half : Vec3d{0.08, 0.06, 0.035};
    if (is_box) middle_m_ = (metres(corners + 3) + metres(corners)) / 2;
    // A parameter that an older device does not know is no reason to refuse it.
    hd.forget_errors();
  }

  Status start() {
    hd_.enable(kForceOutput);
    task_ = hd_.schedule_asynchronous(&Servo::on_tick, this, kHdPriority);
    hd_.start_scheduler();
    const Library::Failure error = hd_.get_error();
    if (error.short_code() == 0) return {};
    return Error{ErrorCode::ResourceMissing, "the scheduler of OpenHaptics does not start (" +
                                                 hd_.text_of(error) + "), " + kHdAdvice};
  }

  // The last tick writes no force. A scheduler that is stuck is not waited for: it is stopped.
  ~Servo() {
    is_closing_ = true;
    const auto until = std::chrono::steady_clock::now() + kHdFarewell;
    while (!has_ended_ && std::chrono::steady_clock::now() < until)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    hd_.stop_scheduler();
    hd_.unschedule(task_);
    hd_.disable_device(device_);
  }

  std::string name;
  DeviceLimits limits;
  DeviceExchange exchange;

 private:
  static unsigned on_tick(void* servo) { return static_cast<Servo*>(servo)->tick(); }

  // Scheduler's thread.
  unsigned tick() {
    const bool is_last = is_closing_ || errors_ == kMostDeviceErrors;
    DeviceReading reading;
    hd_.begin_frame(device_);
    const bool is_read = read(reading);
    const Vec3d f = is_last ? Vec3d{} : exchange.order(monotonic_us()).force_n;
    const double force_n[3] = {f.x, f.y, f.z};
    hd_.set_doublev(kForce, force_n);
    hd_.end_frame(device_);
    if (is_last) {
      has_ended_ = true;
      return kCallNoMore;
    }
    const Library::Failure error = hd_.get_error();
    if (error.short_code() != 0) hd_.forget_errors();
    if (error.short_code() == 0 || error.is_of_force()) {
      if (is_read) exchange.publish(reading);
      errors_ = 0;
    } else if (++errors_ == kMostDeviceErrors) {
      exchange.fail(
          {ErrorCode::ResourceMissing, "the " + name + " is gone (" + hd_.text_of(error) +
                                           "), check its cable and its power and open it again"});
    }
    return kCallAgain;
  }

  bool read(DeviceReading& reading) const {
    double position_mm[16]{}, velocity_mm_s[16]{}, transform[16]{};
    int buttons[16]{};
    hd_.get_doublev(kPosition, position_mm);
    hd_.get_doublev(kVelocity, velocity_mm_s);
    hd_.get_doublev(kTransform, transform);
    hd_.get_integerv(kButtonState, buttons);
    double rows[3][3];
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column) rows[row][column] = transform[4 * column + row];
    const auto orientation = orientation_of(rows);
    if (!orientation) return false;
    reading.position_m = metres(position_mm) - middle_m_;
    reading.velocity_m_s = metres(velocity_mm_s);
    reading.orientation = *orientation;
    reading.buttons = static_cast<std::uint32_t>(buttons[0]) & 0xf;
    reading.time_us = monotonic_us();
    return true;
  }

  const Library hd_;
  const unsigned device_;
  unsigned long task_ = 0;
  Vec3d middle_m_;
  int errors_ = 0;  // in a row; scheduler's thread
  std::atomic<bool> is_closing_{false}, has_ended_{false};
};

OpenHapticsDevice::OpenHapticsDevice(std::unique_ptr<Servo> servo) : servo_(std::move(servo)) {}
OpenHapticsDevice::~OpenHapticsDevice() = default;

Status OpenHapticsDevice::check_library(const std::vector<std::string>& names) {
  const auto hd = load(names);
  return hd ? Status{} : Status{hd.error()};
}

Result<std::unique_ptr<HapticDevice>> OpenHapticsDevice::open(const std::vector<std::string>& names,
                                                              const std::string& name) {
  const auto hd = load(names);
  if (!hd) return hd.error();
  hd->forget_errors();
  const bool is_default = name.empty() || name == kDefaultDevice;
  const unsigned device = hd->init_device(is_default ? nullptr : name.c_str());
  const Library::Failure error = hd->get_error();
  if (error.short_code() != 0 || device == kNoDevice) {
    if (device != kNoDevice) hd->disable_device(device);
    return Error{ErrorCode::ResourceMissing,
                 "OpenHaptics cannot open \"" + printable(name, 60) + "\" (" + hd->text_of(error) +
                     "), plug it in, and set it up and name it in the maker's setup program"};
  }
  hd->make_current_device(device);
  auto servo = std::make_unique<Servo>(*hd, device);
  if (auto status = servo->start(); !status) return status.error();
  return std::unique_ptr<HapticDevice>(new OpenHapticsDevice(std::move(servo)));
}

Result<DeviceReading> OpenHapticsDevice::read() {
  return servo_->exchange.read();
}

Status OpenHapticsDevice::write(const Vec3d& force_n, const Vec3d& torque_nm) {
  return servo_->exchange.write(force_n, torque_nm, servo_->limits);
}

DeviceLimits OpenHapticsDevice::limits() const {
  return servo_->limits;
}

std::string OpenHapticsDevice::description() const {
  return servo_->name + " through OpenHaptics";
}

}  // namespace trocar::device
