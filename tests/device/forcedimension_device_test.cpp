#include "client/device/forcedimension_device.h"

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/device/device_bench.h"
#include "tests/device/fake_dhd.h"

namespace trocar::device {
namespace {

using testing::eventually;

const std::vector<std::string> kDhdLibrary{"libdhd-that-is-not-there.so", FAKE_DHD};

class ForceDimensionTest : public ::testing::Test {
 protected:
  void SetUp() override {
    void* library = dlopen(FAKE_DHD, RTLD_NOW | RTLD_LOCAL);
    ASSERT_NE(library, nullptr) << dlerror();
    const auto access = reinterpret_cast<testing::FakeDhdAccess>(dlsym(library, "fake_dhd"));
    ASSERT_NE(access, nullptr);
    fake_ = new (access()) testing::FakeDhd;
  }
  std::unique_ptr<HapticDevice> open() {
    auto opened = ForceDimensionDevice::open(kDhdLibrary, 0);
    EXPECT_TRUE(opened.ok()) << opened.error().message;
    await_exchanges();
    return std::move(*opened);
  }
  void await_exchanges(int count = 3) {
    const int before = fake_->exchanges;
    EXPECT_TRUE(eventually([&] { return fake_->exchanges >= before + count; }));
  }
  void set_position(double x, double y, double z) {
    fake_->position[0] = x, fake_->position[1] = y, fake_->position[2] = z;
  }

  testing::FakeDhd* fake_ = nullptr;
};

TEST_F(ForceDimensionTest, ReadsTheHandInOurFrame) {
  set_position(0.01, 0.02, 0.03);
  fake_->buttons = 0b1001;
  fake_->gripper_rad = 0.09;
  const auto device = open();
  EXPECT_EQ(device->description(), "Force Dimension sigma.7");
  EXPECT_EQ(device->limits().torque_nm, 0.4);
  const auto reading = device->read();
  ASSERT_TRUE(reading.ok());
  EXPECT_EQ(reading->position_m, (Vec3d{0.02, 0.03, 0.01}));
  EXPECT_EQ(reading->velocity_m_s, (Vec3d{0.2, 0.3, 0.1}));
  EXPECT_EQ(reading->buttons, 0b1001u);
  EXPECT_NEAR(reading->gripper, 0.8f, 1e-5f);
  // A quarter of a turn about the vertical takes the direction to the person to the right.
  EXPECT_NEAR(length(rotate(reading->orientation, {0, 0, 1}) - Vec3f{1, 0, 0}), 0, 1e-5f);
  EXPECT_TRUE(eventually([&] { return device->read()->time_us > reading->time_us; }));
}

TEST_F(ForceDimensionTest, RendersForceAndTorqueInItsFrame) {
  const auto device = open();
  EXPECT_EQ(fake_->watchdog_ms, 100);
  EXPECT_TRUE(fake_->is_force_enabled);
  EXPECT_TRUE(eventually([&] {
    EXPECT_TRUE(device->write({1, 2, 3}, {0.1, 0.2, 0.3}).ok());
    const auto& f = fake_->force;
    return f[0] == 3 && f[1] == 1 && f[2] == 2 && f[3] == 0.3 && f[4] == 0.1 && f[5] == 0.2 &&
           f[6] == 0;
  }));
  EXPECT_TRUE(eventually([&] { return fake_->last_force_size == 0; })) << "it was not renewed";
  EXPECT_EQ(fake_->wrong_ids, 0);
}

TEST_F(ForceDimensionTest, NoForceIsTooLargeOrNoNumber) {
  const auto device = open();
  EXPECT_TRUE(eventually([&] {
    EXPECT_TRUE(device->write({1e9, 0, 0}, {}).ok());
    return std::abs(fake_->last_force_size - 20) < 1e-9;
  }));
  EXPECT_TRUE(eventually([&] {
    EXPECT_TRUE(device->write({std::nan(""), 0, 0}, {}).ok());
    return fake_->last_force_size == 0;
  }));
}

TEST_F(ForceDimensionTest, ClosingEndsWithNoForceStopAndClose) {
  auto device = open();
  ASSERT_TRUE(eventually([&] {
    EXPECT_TRUE(device->write({0, 1, 0}, {}).ok());
    return fake_->last_force_size == 1;
  }));
  device.reset();
  EXPECT_EQ(fake_->last_force_size, 0);
  EXPECT_EQ(fake_->stops, 1);
  EXPECT_EQ(fake_->closes, 1);
  EXPECT_EQ(fake_->forces_while_closed, 0);
}

TEST_F(ForceDimensionTest, UnpluggedItIsGone) {
  const auto device = open();
  fake_->position_result = -1;
  Result<DeviceReading> reading = DeviceReading{};
  ASSERT_TRUE(eventually([&] { return !(reading = device->read()).ok(); }));
  EXPECT_TRUE(testing::is_advice(reading.error()));
  EXPECT_EQ(reading.error().message.find('\x1b'), std::string::npos);
  EXPECT_FALSE(device->write({}, {}).ok());
  EXPECT_TRUE(eventually([&] { return fake_->closes == 1; }));
}

TEST_F(ForceDimensionTest, OldValuesLeaveTheTimeStanding) {
  const auto device = open();
  fake_->position_result = 1;
  await_exchanges();
  const auto last = device->read();
  await_exchanges(20);
  ASSERT_TRUE(device->read().ok());
  EXPECT_EQ(device->read()->time_us, last->time_us);
  fake_->position_result = 0;
  EXPECT_TRUE(eventually([&] { return device->read()->time_us > last->time_us; }));
}

TEST_F(ForceDimensionTest, ACallThatHangsIsNotWaitedFor) {
  auto device = open();
  fake_->blocks = true;
  // The library may be on its way through one more round.
  std::uint64_t last_us = 0;
  ASSERT_TRUE(eventually([&] {
    const int before = fake_->exchanges;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    last_us = device->read()->time_us;
    return fake_->exchanges == before;
  }));
  for (int i = 0; i < 1000; ++i) {
    ASSERT_TRUE(device->write({0, 1, 0}, {}).ok());
    ASSERT_EQ(device->read()->time_us, last_us);
  }
  fake_->blocks = false;
  EXPECT_TRUE(eventually([&] { return device->read()->time_us > last_us; }));
}

TEST_F(ForceDimensionTest, GarbageIsLeftOut) {
  const auto device = open();
  set_position(0, 0, 0.05);
  await_exchanges();
  for (const double bad : {std::nan(""), 1e300, -1e300}) {
    set_position(bad, 0, 0);
    await_exchanges();
    const auto last = device->read();
    await_exchanges();
    ASSERT_TRUE(last.ok());
    EXPECT_EQ(device->read()->time_us, last->time_us);
    EXPECT_EQ(device->read()->position_m, (Vec3d{0, 0.05, 0}));
  }
  set_position(0, 0, 0);
  fake_->matrix_scale = 0;
  await_exchanges();
  const auto last = device->read();
  await_exchanges();
  EXPECT_EQ(device->read()->time_us, last->time_us) << "a matrix that is no rotation";
}

TEST_F(ForceDimensionTest, AnUnknownModelGetsCautiousLimits) {
  fake_->type = 9999;
  const auto device = open();
  EXPECT_LE(device->limits().force_n, 5);
  EXPECT_GT(device->limits().force_n, 0);
  EXPECT_TRUE(device->read().ok());
}

TEST_F(ForceDimensionTest, WhatCannotBeOpenedSaysWhy) {
  const auto fails = [](const std::vector<std::string>& names, int index, ErrorCode code) {
    const auto opened = ForceDimensionDevice::open(names, index);
    return !opened.ok() && opened.error().code == code && testing::is_advice(opened.error());
  };
  EXPECT_TRUE(fails({"libdhd-that-is-not-there.so"}, 0, ErrorCode::ResourceMissing));
  EXPECT_TRUE(fails({FAKE_DHD_OLD}, 0, ErrorCode::Mismatch)) << "a function is missing";
  EXPECT_TRUE(fails(kDhdLibrary, 1, ErrorCode::ResourceMissing));
  EXPECT_TRUE(fails(kDhdLibrary, -1, ErrorCode::ResourceMissing));
  fake_->may_open = false;
  EXPECT_TRUE(fails(kDhdLibrary, 0, ErrorCode::ResourceMissing));
  fake_->device_count = -1;
  EXPECT_TRUE(fails(kDhdLibrary, 0, ErrorCode::ResourceMissing));
  EXPECT_EQ(ForceDimensionDevice::count(kDhdLibrary).value(), 0);
}

}  // namespace
}  // namespace trocar::device
