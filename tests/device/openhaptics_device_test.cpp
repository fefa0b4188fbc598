#include "client/device/openhaptics_device.h"

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/device/device_bench.h"
#include "tests/device/fake_hd.h"

namespace trocar::device {
namespace {

using testing::eventually;

const std::vector<std::string> kHdLibrary{"libHD-that-is-not-there.so", FAKE_HD};
constexpr unsigned kCommunicationError = 0x0302, kWarmMotors = 0x0200;

class OpenHapticsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    void* library = dlopen(FAKE_HD, RTLD_NOW | RTLD_LOCAL);
    ASSERT_NE(library, nullptr) << dlerror();
    const auto access = reinterpret_cast<testing::FakeHdAccess>(dlsym(library, "fake_hd"));
    ASSERT_NE(access, nullptr);
    fake_ = new (access()) testing::FakeHd;
    set_position(10, 10, 10);
  }
  std::unique_ptr<HapticDevice> open() {
    auto opened = OpenHapticsDevice::open(kHdLibrary, OpenHapticsDevice::kDefaultDevice);
    EXPECT_TRUE(opened.ok()) << opened.error().message;
    await_frames();
    return std::move(*opened);
  }
  void await_frames(int count = 3) {
    const int before = fake_->frames;
    EXPECT_TRUE(eventually([&] { return fake_->frames >= before + count; }));
  }
  void set_position(double x, double y, double z) {
    fake_->position_mm[0] = x, fake_->position_mm[1] = y, fake_->position_mm[2] = z;
  }

  testing::FakeHd* fake_ = nullptr;
};

TEST_F(OpenHapticsTest, ReadsTheHandInMetresFromTheMiddle) {
  set_position(11, 30, -20);
  fake_->buttons = 0b10;
  const auto device = open();
  EXPECT_EQ(device->description(), "Touch through OpenHaptics");
  EXPECT_TRUE(fake_->is_default_device);
  const auto reading = device->read();
  ASSERT_TRUE(reading.ok());
  EXPECT_NEAR(length(reading->position_m - Vec3d{0.001, 0.02, -0.03}), 0, 1e-12);
  EXPECT_NEAR(length(reading->velocity_m_s - Vec3d{0.1, 0.2, 0.3}), 0, 1e-12);
  EXPECT_EQ(reading->buttons, 0b10u);
  EXPECT_NEAR(length(rotate(reading->orientation, {0, 0, 1}) - Vec3f{1, 0, 0}), 0, 1e-5f);
  EXPECT_TRUE(eventually([&] { return device->read()->time_us > reading->time_us; }));
}

TEST_F(OpenHapticsTest, ItsLimitsAreTheDevices) {
  const auto limits = open()->limits();
  EXPECT_EQ(limits.force_n, 3.3);
  EXPECT_EQ(limits.torque_nm, 0);
  EXPECT_EQ(limits.stiffness_n_m, 500);
  EXPECT_NEAR(limits.workspace_m.x, 0.08, 1e-12);
  for (const double bad : {std::nan(""), -1.0, 1e9}) {
    fake_->max_force_n = bad;
    fake_->workspace_scale = bad;
    const auto cautious = open()->limits();
    EXPECT_EQ(cautious.force_n, 3) << bad;
    EXPECT_EQ(cautious.workspace_m.x, 0.08) << bad;
  }
}

TEST_F(OpenHapticsTest, RendersForceWithinFrames) {
  const auto device = open();
  EXPECT_TRUE(fake_->is_force_enabled);
  EXPECT_TRUE(eventually([&] {
    EXPECT_TRUE(device->write({0.1, 0.2, 0.3}, {9, 9, 9}).ok());
    return fake_->force_n[0] == 0.1 && fake_->force_n[1] == 0.2 && fake_->force_n[2] == 0.3;
  }));
  EXPECT_TRUE(eventually([&] { return fake_->last_force_size == 0; })) << "it was not renewed";
  EXPECT_TRUE(eventually([&] {
    EXPECT_TRUE(device->write({1e9, 0, 0}, {}).ok());
    return std::abs(fake_->last_force_size - 3.3) < 1e-9;
  }));
  EXPECT_TRUE(eventually([&] {
    EXPECT_TRUE(device->write({std::nan(""), 0, 0}, {}).ok());
    return fake_->last_force_size == 0;
  }));
  EXPECT_EQ(fake_->calls_outside_frames, 0);
}

TEST_F(OpenHapticsTest, ClosingEndsWithNoForceAndStopsTheScheduler) {
  auto device = open();
  ASSERT_TRUE(eventually([&] {
    EXPECT_TRUE(device->write({0, 1, 0}, {}).ok());
    return fake_->last_force_size == 1;
  }));
  device.reset();
  EXPECT_EQ(fake_->last_force_size, 0);
  EXPECT_EQ(fake_->stops, 1);
  EXPECT_EQ(fake_->unschedules, 1);
  EXPECT_EQ(fake_->disables, 1);
}

TEST_F(OpenHapticsTest, UnpluggedItIsGone) {
  const auto device = open();
  // The upper half of the code is whatever a library with short codes leaves there.
  fake_->frame_error = 0xabcd0000 | kCommunicationError;
  Result<DeviceReading> reading = DeviceReading{};
  ASSERT_TRUE(eventually([&] { return !(reading = device->read()).ok(); }));
  EXPECT_TRUE(testing::is_advice(reading.error()));
  EXPECT_EQ(reading.error().message.find('\x1b'), std::string::npos);
  EXPECT_FALSE(device->write({}, {}).ok());
}

TEST_F(OpenHapticsTest, WarmMotorsAreNoReasonToStopReading) {
  const auto device = open();
  fake_->frame_error = kWarmMotors;
  await_frames(30);
  const auto last = device->read();
  ASSERT_TRUE(last.ok());
  EXPECT_TRUE(eventually([&] { return device->read()->time_us > last->time_us; }));
}

TEST_F(OpenHapticsTest, AStuckSchedulerLeavesTheTimeStandingAndIsNotWaitedForAtTheEnd) {
  auto device = open();
  fake_->is_stuck = true;
  // One more frame may be under way.
  std::uint64_t last_us = 0;
  ASSERT_TRUE(eventually([&] {
    const int before = fake_->frames;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    last_us = device->read()->time_us;
    return fake_->frames == before;
  }));
  for (int i = 0; i < 1000; ++i) {
    ASSERT_TRUE(device->write({0, 1, 0}, {}).ok());
    ASSERT_EQ(device->read()->time_us, last_us);
  }
  device.reset();
  EXPECT_EQ(fake_->stops, 1);
}

TEST_F(OpenHapticsTest, GarbageIsLeftOut) {
  const auto device = open();
  for (const double bad : {std::nan(""), 1e300, -1e300}) {
    set_position(bad, 0, 0);
    await_frames();
    const auto last = device->read();
    await_frames();
    ASSERT_TRUE(last.ok());
    EXPECT_EQ(device->read()->time_us, last->time_us);
    EXPECT_NEAR(length(device->read()->position_m), 0, 1e-12);
  }
  set_position(0, 0, 0);
  fake_->matrix_scale = 0;
  await_frames();
  const auto last = device->read();
  await_frames();
  EXPECT_EQ(device->read()->time_us, last->time_us) << "a matrix that is no rotation";
}

TEST_F(OpenHapticsTest, WhatCannotBeOpenedSaysWhy) {
  const auto fails = [](const std::vector<std::string>& names, ErrorCode code) {
    const auto opened = OpenHapticsDevice::open(names, "Left hand");
    return !opened.ok() && opened.error().code == code && testing::is_advice(opened.error());
  };
  EXPECT_TRUE(fails({"libHD-that-is-not-there.so"}, ErrorCode::ResourceMissing));
  EXPECT_TRUE(fails({FAKE_HD_OLD}, ErrorCode::Mismatch)) << "a function is missing";
  fake_->init_error = kCommunicationError;
  EXPECT_TRUE(fails(kHdLibrary, ErrorCode::ResourceMissing));
  EXPECT_FALSE(fake_->is_default_device);
  fake_->init_error = 0;
  fake_->start_error = 0x0304;
  EXPECT_TRUE(fails(kHdLibrary, ErrorCode::ResourceMissing));
  EXPECT_EQ(fake_->disables, 1) << "it was opened, and is let go";
}

}  // namespace
}  // namespace trocar::device
