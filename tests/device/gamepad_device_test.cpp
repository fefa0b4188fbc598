// The kernel's side of a gamepad is played by a pair of sockets, for events and rumble orders, and
// by an ioctl() of the test's: a real one needs /dev/uinput, and rights to it.

#include "client/device/gamepad_device.h"

#include <gtest/gtest.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <climits>
#include <cmath>
#include <csignal>
#include <cstring>
#include <map>

#include "client/device/device_checks.h"
#include "tests/device/device_bench.h"
#include "tests/support/random.h"

namespace trocar::device {
namespace {

struct FakePad {
  bool is_gamepad = true, has_rumble = true, is_gone = false;
  std::map<int, input_absinfo> axes;  // by code
  std::vector<int> pressed;
  int uploads = 0;
  ff_effect effect{};

  FakePad() {
    for (const int code : {ABS_X, ABS_Y, ABS_RX, ABS_RY})
      axes[code] = {.value = 0, .minimum = -32768, .maximum = 32767};
    axes[ABS_RZ] = {.value = 0, .minimum = 0, .maximum = 255};
  }

  int answer(unsigned long request, void* argument) {
    const auto size = _IOC_SIZE(request);
    const auto set = [&](std::size_t bit) {
      ASSERT_LT(bit / 8, size);
      static_cast<std::uint8_t*>(argument)[bit / 8] |= static_cast<std::uint8_t>(1u << (bit % 8));
    };
    errno = is_gone ? ENODEV : EINVAL;
    if (is_gone) return -1;
    if (request == EVIOCSFF) {
      effect = *static_cast<ff_effect*>(argument);
      static_cast<ff_effect*>(argument)->id = 4;
      ++uploads;
      return 0;
    }
    const auto number = _IOC_NR(request);
    if (number == _IOC_NR(EVIOCGNAME(0))) {
      std::strncpy(static_cast<char*>(argument), "Pad \x1b[2J", size);
    } else if (number == _IOC_NR(EVIOCGKEY(0))) {
      for (const int key : pressed) set(static_cast<std::size_t>(key));
    } else if (number == _IOC_NR(EVIOCGBIT(EV_KEY, 0))) {
      if (is_gamepad) set(BTN_GAMEPAD);
    } else if (number == _IOC_NR(EVIOCGBIT(EV_ABS, 0))) {
      for (const auto& [code, range] : axes) set(static_cast<std::size_t>(code));
    } else if (number == _IOC_NR(EVIOCGBIT(EV_FF, 0))) {
      if (has_rumble) set(FF_RUMBLE);
    } else if (number >= _IOC_NR(EVIOCGABS(0)) && number <= _IOC_NR(EVIOCGABS(ABS_MAX))) {
      const auto axis = axes.find(static_cast<int>(number - _IOC_NR(EVIOCGABS(0))));
      if (axis == axes.end()) return -1;
      *static_cast<input_absinfo*>(argument) = axis->second;
    } else {
      return -1;
    }
    return 0;
  }
};

class GamepadTest : public ::testing::Test {
 protected:
  Result<std::unique_ptr<HapticDevice>> try_open() {
    // A socket without its other end would end the program; a device of the kernel says ENODEV.
    signal(SIGPIPE, SIG_IGN);
    int ends[2];
    EXPECT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends), 0);
    kernel_ = FileDescriptor(ends[1]);
    return GamepadDevice::adopt(
        FileDescriptor(ends[0]), "/dev/input/event5",
        [this](int, unsigned long request, void* argument) {
          return pad_.answer(request, argument);
        },
        [this] { return now_us_; });
  }
  void open() {
    auto opened = try_open();
    ASSERT_TRUE(opened.ok()) << opened.error().message;
    device_ = std::move(*opened);
  }
  void send_bytes(const void* bytes, std::size_t count) {
    ASSERT_EQ(send(kernel_.value(), bytes, count, MSG_NOSIGNAL), static_cast<ssize_t>(count));
  }
  void send_event(int type, int code, int value) {
    input_event event{};
    event.type = static_cast<std::uint16_t>(type);
    event.code = static_cast<std::uint16_t>(code);
    event.value = value;
    send_bytes(&event, sizeof event);
  }
  DeviceReading after_ms(std::uint64_t ms) {
    now_us_ += ms * 1000;
    auto reading = device_->read();
    EXPECT_TRUE(reading.ok());
    EXPECT_TRUE(checked(*reading).has_value());
    EXPECT_EQ(reading->time_us, now_us_);
    return *reading;
  }
  // The rumble orders since the last call: 1 play, 0 stop.
  std::vector<int> orders() {
    std::vector<int> values;
    input_event event{};
    while (recv(kernel_.value(), &event, sizeof event, 0) == sizeof event) {
      EXPECT_EQ(event.type, EV_FF);
      EXPECT_EQ(event.code, 4);
      values.push_back(event.value);
    }
    return values;
  }

  FakePad pad_;
  FileDescriptor kernel_;
  std::uint64_t now_us_ = 1'000'000;
  std::unique_ptr<HapticDevice> device_;
};

TEST_F(GamepadTest, SticksMoveTheHand) {
  open();
  after_ms(0);
  EXPECT_EQ(device_->description(), "gamepad Pad ?[2J with rumble");
  send_event(EV_ABS, ABS_X, 32767);
  send_event(EV_ABS, ABS_Y, -32768);
  send_event(EV_ABS, ABS_RY, -32768);
  send_event(EV_SYN, SYN_REPORT, 0);
  for (int i = 0; i < 100; ++i) after_ms(10);
  const auto reading = after_ms(0);
  EXPECT_NEAR(length(reading.position_m - Vec3d{0.08, 0.08, -0.08}), 0, 1e-5);
  send_event(EV_ABS, ABS_X, 2000);
  send_event(EV_ABS, ABS_Y, -2000);
  send_event(EV_ABS, ABS_RY, 0);
  after_ms(0);
  EXPECT_EQ(after_ms(40).position_m, reading.position_m) << "inside the dead zone";
}

TEST_F(GamepadTest, TheRightStickTurnsAndTheTriggerGrips) {
  open();
  after_ms(0);
  send_event(EV_ABS, ABS_RX, 32767);
  send_event(EV_ABS, ABS_RZ, 51);
  send_event(EV_KEY, BTN_SOUTH, 1);
  send_event(EV_KEY, BTN_TR, 1);
  for (int i = 0; i < 100; ++i) after_ms(10);
  auto reading = after_ms(0);
  const Vec3f ahead = rotate(reading.orientation, {0, 0, -1});
  EXPECT_NEAR(std::atan2(ahead.x, -ahead.z), 1.2, 2e-3) << "to the right";
  EXPECT_NEAR(reading.gripper, 0.2f, 1e-6f);
  EXPECT_EQ(reading.buttons, 0b100001u);
  send_event(EV_KEY, BTN_SOUTH, 0);
  EXPECT_EQ(after_ms(1).buttons, 0b100000u);
}

TEST_F(GamepadTest, WhatWasPressedBeforeAndWhatWasLostIsAskedFor) {
  pad_.pressed = {BTN_EAST};
  open();
  EXPECT_EQ(after_ms(1).buttons, 0b10u);
  send_event(EV_SYN, SYN_DROPPED, 0);
  send_event(EV_KEY, BTN_WEST, 1);
  EXPECT_EQ(after_ms(1).buttons, 0b10u) << "what comes after a loss is not whole";
  pad_.pressed = {BTN_NORTH};
  pad_.axes[ABS_RZ].value = 255;
  send_event(EV_SYN, SYN_REPORT, 0);
  EXPECT_EQ(after_ms(1).buttons, 0b100u);
  EXPECT_EQ(after_ms(1).gripper, 1.0f);
}

TEST_F(GamepadTest, RumbleGrowsWithTheForceAndEndsWithIt) {
  open();
  const int uploads = pad_.uploads;
  ASSERT_TRUE(device_->write({0, 0, 0}, {}).ok());
  EXPECT_TRUE(orders().empty());
  ASSERT_TRUE(device_->write({0, 1, 0}, {}).ok());
  EXPECT_EQ(orders(), std::vector{1});
  EXPECT_NEAR(pad_.effect.u.rumble.strong_magnitude, 0x7fff, 1);
  EXPECT_EQ(pad_.effect.type, FF_RUMBLE);
  EXPECT_GT(pad_.effect.replay.length, 0) << "it ends by itself";
  now_us_ += 50'000;
  ASSERT_TRUE(device_->write({0, 0, 1e9}, {}).ok());
  EXPECT_EQ(pad_.effect.u.rumble.strong_magnitude, 0xffff);
  EXPECT_EQ(pad_.uploads, uploads + 2);
  ASSERT_TRUE(device_->write({NAN, 0, 0}, {}).ok());
  EXPECT_EQ(orders(), (std::vector{1, 0}));
}

TEST_F(GamepadTest, AThousandWritesASecondAreFewOrders) {
  open();
  testing::Random random(3);
  for (int ms = 0; ms < 1000; ++ms) {
    now_us_ += 1000;
    ASSERT_TRUE(device_->write({0, 0.2 + 1.5 * random.unit(), 0}, {}).ok());
  }
  EXPECT_LE(orders().size(), 25u);
  for (int ms = 0; ms < 1000; ++ms) {
    now_us_ += 1000;
    ASSERT_TRUE(device_->write({0, 1, 0}, {}).ok());
  }
  const auto renewed = orders().size();
  EXPECT_GE(renewed, 9u) << "a rumble of 0.2 s goes on";
  EXPECT_LE(renewed, 12u);
}

TEST_F(GamepadTest, ClosingStopsTheRumble) {
  open();
  ASSERT_TRUE(device_->write({0, 1, 0}, {}).ok());
  device_.reset();
  EXPECT_EQ(orders(), (std::vector{1, 0}));
}

TEST_F(GamepadTest, APadWithoutRumbleOrSticksWorks) {
  pad_.has_rumble = false;
  pad_.axes.erase(ABS_RX);
  pad_.axes[ABS_RY] = {.value = 5, .minimum = 7, .maximum = 7};
  pad_.axes[ABS_RZ] = {.value = 5, .minimum = INT_MAX, .maximum = INT_MIN};
  open();
  EXPECT_EQ(device_->limits().force_n, 0);
  ASSERT_TRUE(device_->write({0, 1, 0}, {}).ok());
  EXPECT_TRUE(orders().empty());
  send_event(EV_ABS, ABS_RX, 30000);
  after_ms(10);
  EXPECT_EQ(after_ms(10).position_m, Vec3d{});
}

TEST_F(GamepadTest, PulledOutItIsGone) {
  open();
  kernel_ = FileDescriptor();
  const auto gone = device_->read();
  ASSERT_FALSE(gone.ok());
  EXPECT_TRUE(testing::is_advice(gone.error())) << gone.error().message;
  pad_.is_gone = true;
  EXPECT_FALSE(device_->write({0, 1, 0}, {}).ok());
}

TEST_F(GamepadTest, EventsThatComeInPiecesAreJoined) {
  open();
  input_event event{};
  event.type = EV_KEY, event.code = BTN_START, event.value = 1;
  const auto* bytes = reinterpret_cast<const char*>(&event);
  for (std::size_t i = 0; i < sizeof event; ++i) {
    EXPECT_EQ(after_ms(1).buttons, 0u);
    send_bytes(bytes + i, 1);
  }
  EXPECT_EQ(after_ms(1).buttons, 0b10000000u);
}

TEST_F(GamepadTest, GarbageMovesNothingBeyondTheReach) {
  open();
  testing::Random random(5);
  for (int i = 0; i < 3000; ++i) {
    send_event(static_cast<int>(random.below(8)), static_cast<int>(random.below(0x300)),
               static_cast<int>(random.below(UINT_MAX)));
    ASSERT_LE(length(after_ms(1).position_m), 0.15 * std::sqrt(3.0));
  }
  for (const int extreme : {INT_MAX, INT_MIN})
    for (const int axis : {ABS_X, ABS_Y, ABS_RX, ABS_RY, ABS_RZ}) {
      send_event(EV_ABS, axis, extreme);
      after_ms(10);
    }
}

TEST_F(GamepadTest, AKeyboardIsRefused) {
  pad_.is_gamepad = false;
  const auto opened = try_open();
  ASSERT_FALSE(opened.ok());
  EXPECT_TRUE(testing::is_advice(opened.error())) << opened.error().message;
}

TEST(Gamepad, WhatIsNotThereOrNoDeviceIsRefusedByTheRealKernel) {
  const testing::ShortFolder folder;
  for (const std::string& path : {folder.file("event7"), std::string("/dev/null")}) {
    const auto opened = GamepadDevice::open(path, monotonic_us);
    ASSERT_FALSE(opened.ok());
    EXPECT_TRUE(testing::is_advice(opened.error())) << opened.error().message;
  }
  EXPECT_TRUE(GamepadDevice::find(folder.file("none")).empty());
}

}  // namespace
}  // namespace trocar::device
