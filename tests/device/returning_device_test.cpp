#include "client/device/returning_device.h"

#include <gtest/gtest.h>

#include <atomic>

#include "tests/device/device_bench.h"

namespace trocar::device {
namespace {

// Plugs that a test pulls.
struct Socket {
  std::atomic<bool> is_plugged{true};
  std::atomic<int> opened{0}, closed{0};
  std::atomic<double> place_m{0};
};

class PluggedDevice final : public HapticDevice {
 public:
  explicit PluggedDevice(Socket& socket) : socket_(socket) { ++socket_.opened; }
  ~PluggedDevice() override { ++socket_.closed; }
  Result<DeviceReading> read() override {
    if (!socket_.is_plugged) return Error{ErrorCode::ResourceMissing, "unplugged"};
    DeviceReading reading;
    reading.position_m.x = socket_.place_m;
    reading.time_us = ++time_us_;
    return reading;
  }
  Status write(const Vec3d&, const Vec3d&) override {
    if (!socket_.is_plugged) return Error{ErrorCode::ResourceMissing, "unplugged"};
    return {};
  }
  DeviceLimits limits() const override { return {.force_n = 2}; }
  std::string description() const override { return "plugged device"; }

 private:
  Socket& socket_;
  std::uint64_t time_us_ = 0;
};

auto opener(Socket& socket) {
  return [&socket]() -> Result<std::unique_ptr<HapticDevice>> {
    if (!socket.is_plugged) return Error{ErrorCode::ResourceMissing, "nothing is there"};
    return std::unique_ptr<HapticDevice>(std::make_unique<PluggedDevice>(socket));
  };
}

TEST(ReturningDevice, OneThatIsNotThereIsAnError) {
  Socket socket;
  socket.is_plugged = false;
  const auto device = ReturningDevice::open(opener(socket));
  ASSERT_FALSE(device.ok());
  EXPECT_EQ(device.error().message, "nothing is there");
}

TEST(ReturningDevice, WhileItIsGoneItsTimeStandsStillAndThenTheHandTakesItAgain) {
  Socket socket;
  const auto device = ReturningDevice::open(opener(socket));
  ASSERT_TRUE(device.ok());
  EXPECT_EQ((*device)->limits().force_n, 2);
  for (int round = 1; round <= 2; ++round) {
    socket.place_m = 0.01 * round;
    const auto before = (*device)->read();
    ASSERT_TRUE(before.ok());
    EXPECT_EQ(before->buttons, 0u);
    socket.is_plugged = false;
    if (round == 2) {
      EXPECT_TRUE((*device)->write({1, 0, 0}, {}).ok()) << "write finds it out, too";
    }
    for (int i = 0; i < 20; ++i) {
      const auto reading = (*device)->read();
      ASSERT_TRUE(reading.ok());
      EXPECT_EQ(reading->time_us, before->time_us);
      EXPECT_EQ(reading->buttons, kRestsButton);
      EXPECT_EQ(reading->position_m, before->position_m);
      EXPECT_TRUE((*device)->write({1, 0, 0}, {}).ok());
    }
    socket.place_m = 0.5;
    socket.is_plugged = true;
    Result<DeviceReading> back = *before;
    ASSERT_TRUE(testing::eventually([&] {
      back = (*device)->read();
      return back->position_m.x == 0.5;
    }));
    EXPECT_EQ(back->buttons, kLetGoButton) << "the first of it";
    EXPECT_EQ((*device)->read()->buttons, 0u);
    EXPECT_EQ(socket.opened, round + 1);
    EXPECT_EQ(socket.closed, round);
  }
}

TEST(ReturningDevice, EndsWhileItIsGone) {
  Socket socket;
  {
    const auto device = ReturningDevice::open(opener(socket));
    ASSERT_TRUE(device.ok());
    socket.is_plugged = false;
    EXPECT_TRUE((*device)->read().ok());
  }
  EXPECT_EQ(socket.opened, 1);
  EXPECT_EQ(socket.closed, 1);
}

}  // namespace
}  // namespace trocar::device
