#include "client/device/forcedimension_device.h"

#include <algorithm>
#include <array>
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

constexpr const char* kDhdAdvice =
    "install the Force Dimension SDK (forcedimension.com) and put its folder of libraries into "
    "LD_LIBRARY_PATH";
constexpr std::chrono::milliseconds kDhdPace{1};
constexpr unsigned char kWatchdogMs = 100;
constexpr double kOpenGripRad = 0.45;  // of omega.7 and sigma.7

// Forces and reach as in the maker's data sheets, stiffness below what they say. `reach_m`: half of
// the workspace, in our directions.
struct Model {
  int type;
  const char* name;
  bool has_wrist, has_gripper;
  double force_n, torque_nm, stiffness_n_m;
  Vec3d reach_m;
};
constexpr std::array kModels{
    Model{33, "omega.3", false, false, 12, 0, 3000, {0.08, 0.08, 0.055}},
    Model{34, "omega.6", true, false, 12, 0, 3000, {0.08, 0.08, 0.055}},
    Model{36, "omega.6 (left)", true, false, 12, 0, 3000, {0.08, 0.08, 0.055}},
    Model{35, "omega.7", true, true, 12, 0, 3000, {0.08, 0.08, 0.055}},
    Model{37, "omega.7 (left)", true, true, 12, 0, 3000, {0.08, 0.08, 0.055}},
    Model{60, "Falcon", false, false, 8, 0, 1500, {0.05, 0.05, 0.05}},
    Model{63, "delta.3", false, false, 20, 0, 3000, {0.2, 0.2, 0.13}},
    Model{64, "delta.6", true, false, 20, 0.2, 3000, {0.2, 0.2, 0.13}},
    Model{104, "sigma.7", true, true, 20, 0.4, 3000, {0.095, 0.095, 0.065}},
    Model{105, "sigma.7 (left)", true, true, 20, 0.4, 3000, {0.095, 0.095, 0.065}},
};
constexpr Model kUnknownModel{0, "device", false, false, 5, 0, 1000, {0.05, 0.05, 0.05}};

Model dhd_model_of(int type) {
  const auto* found = std::ranges::find(kModels, type, &Model::type);
  return found == kModels.end() ? kUnknownModel : *found;
}

Vec3d to_ours(const double (&v)[3]) {
  return {v[1], v[2], v[0]};
}

}  // namespace

// Functions of libdhd 3. The last argument is always the device's id: in C it has no default.
struct ForceDimensionDevice::Library {
  int (*get_device_count)() = nullptr;
  int (*open_id)(char) = nullptr;
  int (*close)(char) = nullptr;
  int (*stop)(char) = nullptr;
  int (*get_system_type)(char) = nullptr;
  int (*enable_force)(unsigned char, char) = nullptr;
  int (*set_watchdog)(unsigned char, char) = nullptr;
  int (*get_position)(double*, double*, double*, char) = nullptr;
  int (*get_linear_velocity)(double*, double*, double*, char) = nullptr;
  int (*get_orientation_frame)(double[3][3], char) = nullptr;
  int (*get_gripper_angle_rad)(double*, char) = nullptr;
  int (*get_button)(int, char) = nullptr;
  int (*set_force)(double, double, double, double, double, double, double, char) = nullptr;
  const char* (*error_get_last_str)() = nullptr;
};

Result<ForceDimensionDevice::Library> ForceDimensionDevice::load(
    const std::vector<std::string>& names) {
  auto library = SharedObject::open(names, kDhdAdvice);
  if (!library) return library.error();
  Library dhd;
  library->bind("dhdGetDeviceCount", dhd.get_device_count);
  library->bind("dhdOpenID", dhd.open_id);
  library->bind("dhdClose", dhd.close);
  library->bind("dhdStop", dhd.stop);
  library->bind("dhdGetSystemType", dhd.get_system_type);
  library->bind("dhdEnableForce", dhd.enable_force);
  library->bind("dhdSetWatchdog", dhd.set_watchdog);
  library->bind("dhdGetPosition", dhd.get_position);
  library->bind("dhdGetLinearVelocity", dhd.get_linear_velocity);
  library->bind("dhdGetOrientationFrame", dhd.get_orientation_frame);
  library->bind("dhdGetGripperAngleRad", dhd.get_gripper_angle_rad);
  library->bind("dhdGetButton", dhd.get_button);
  library->bind("dhdSetForceAndTorqueAndGripperForce", dhd.set_force);
  library->bind("dhdErrorGetLastStr", dhd.error_get_last_str);
  if (auto status = library->check(); !status) return status.error();
  return dhd;
}

class ForceDimensionDevice::Servo {
 public:
  Servo(const Library& dhd, char id) : dhd_(dhd), id_(id) {
    const Model model = dhd_model_of(dhd.get_system_type(id));
    name = model.name;
    limits = {model.force_n, model.torque_nm, 1000, model.stiffness_n_m, model.reach_m};
    has_wrist_ = model.has_wrist;
    has_gripper_ = model.has_gripper;
    thread_ = std::thread([this] { run(); });
  }
  ~Servo() {
    is_closing_ = true;
    thread_.join();
  }

  // These two do not change after the constructor.
  std::string name;
  DeviceLimits limits;
  DeviceExchange exchange;

 private:
  void run() {
    auto next = std::chrono::steady_clock::now();
    int errors = 0;
    while (!is_closing_ && errors < kMostDeviceErrors) {
      errors = exchange_once() ? 0 : errors + 1;
      // No step is made up for: a device that is slower than the pace sets its own.
      next = std::max(next + kDhdPace, std::chrono::steady_clock::now());
      std::this_thread::sleep_until(next);
    }
    if (!is_closing_) {
      const char* why = dhd_.error_get_last_str();
      exchange.fail(
          {ErrorCode::ResourceMissing, "the " + name + " is gone (" +
                                           printable(why == nullptr ? "no reason" : why, 200) +
                                           "), check its cable and its power and open it again"});
    }
    dhd_.set_force(0, 0, 0, 0, 0, 0, 0, id_);
    dhd_.stop(id_);
    dhd_.close(id_);
  }

  // False: the device did not answer.
  bool exchange_once() {
    DeviceReading reading;
    double position[3]{}, velocity[3]{};
    const int got = dhd_.get_position(&position[0], &position[1], &position[2], id_);
    const bool is_answered =
        got >= 0 && dhd_.get_linear_velocity(&velocity[0], &velocity[1], &velocity[2], id_) >= 0;
    reading.position_m = to_ours(position);
    reading.velocity_m_s = to_ours(velocity);
    reading.time_us = monotonic_us();
    // Above 0: the library gives the values of before, because it asked the device too recently.
    const bool is_new = is_answered && got == 0 && read_wrist(reading) && read_gripper(reading);
    for (int button = 0; is_new && button < 4; ++button)
      if (dhd_.get_button(button, id_) > 0) reading.buttons |= 1u << button;
    if (is_new) exchange.publish(reading);
    const ForceOrder order = exchange.order(monotonic_us());
    const Vec3d &f = order.force_n, &t = order.torque_nm;
    return dhd_.set_force(f.z, f.x, f.y, t.z, t.x, t.y, 0, id_) >= 0 && is_answered;
  }

  bool read_wrist(DeviceReading& reading) {
    if (!has_wrist_) return true;
    double rows[3][3]{};
    if (dhd_.get_orientation_frame(rows, id_) < 0) return false;
    const auto theirs = orientation_of(rows);
    if (!theirs) return false;
    // The change of directions is itself a rotation, so only the axis of the turn changes.
    reading.orientation = {theirs->y, theirs->z, theirs->x, theirs->w};
    return true;
  }

  bool read_gripper(DeviceReading& reading) {
    if (!has_gripper_) return true;
    double angle_rad = 0;
    if (dhd_.get_gripper_angle_rad(&angle_rad, id_) < 0) return false;
    // Left-handed devices count the other way.
    reading.gripper = static_cast<float>(1 - std::abs(angle_rad) / kOpenGripRad);
    return true;
  }

  const Library dhd_;
  const char id_;
  bool has_wrist_ = false, has_gripper_ = false;
  std::atomic<bool> is_closing_{false};
  std::thread thread_;
};

ForceDimensionDevice::ForceDimensionDevice(std::unique_ptr<Servo> servo)
    : servo_(std::move(servo)) {}
ForceDimensionDevice::~ForceDimensionDevice() = default;

Result<int> ForceDimensionDevice::count(const std::vector<std::string>& names) {
  const auto dhd = load(names);
  if (!dhd) return dhd.error();
  return std::max(0, dhd->get_device_count());
}

Result<std::unique_ptr<HapticDevice>> ForceDimensionDevice::open(
    const std::vector<std::string>& names, int index) {
  const auto dhd = load(names);
  if (!dhd) return dhd.error();
  const int count = dhd->get_device_count();
  if (index < 0 || index > 127 || index >= count)
    return Error{ErrorCode::ResourceMissing,
                 "libdhd sees " + std::to_string(std::max(0, count)) + " devices and number " +
                     std::to_string(index) +
                     " is not among them, plug it in, switch it on and allow its USB device "
                     "(vendor 1451, Falcon 0403:cb48) to this user by a udev rule"};
  const int id = dhd->open_id(static_cast<char>(index));
  const char* why = nullptr;
  if (id < 0 || id > 127) {
    why = dhd->error_get_last_str();
  } else if (dhd->set_watchdog(kWatchdogMs, static_cast<char>(id)) < 0 ||
             dhd->enable_force(1, static_cast<char>(id)) < 0) {
    why = dhd->error_get_last_str();
    dhd->close(static_cast<char>(id));
  } else {
    return std::unique_ptr<HapticDevice>(
        new ForceDimensionDevice(std::make_unique<Servo>(*dhd, static_cast<char>(id))));
  }
  return Error{ErrorCode::ResourceMissing, "the Force Dimension device " + std::to_string(index) +
                                               " cannot be opened (" +
                                               printable(why == nullptr ? "no reason" : why, 200) +
                                               "), end other programs that use it"};
}

Result<DeviceReading> ForceDimensionDevice::read() {
  return servo_->exchange.read();
}

Status ForceDimensionDevice::write(const Vec3d& force_n, const Vec3d& torque_nm) {
  return servo_->exchange.write(force_n, torque_nm, limits());
}

DeviceLimits ForceDimensionDevice::limits() const {
  return servo_->limits;
}

std::string ForceDimensionDevice::description() const {
  return "Force Dimension " + servo_->name;
}

}  // namespace trocar::device
