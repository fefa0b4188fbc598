#include "client/device/device_checks.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/support/random.h"

namespace trocar::device {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(DeviceChecks, AReadingIsTakenOnlyIfAHandCanBeThere) {
  EXPECT_TRUE(checked({}).has_value());
  for (const double bad : {kNan, kInfinity, -kInfinity, 1e300, 2.001}) {
    EXPECT_FALSE(checked({.position_m = {0, bad, 0}}).has_value()) << bad;
    EXPECT_FALSE(checked({.velocity_m_s = {0, 0, bad * 10}}).has_value()) << bad;
  }
  EXPECT_TRUE(checked({.position_m = {1.999, 0, 0}, .velocity_m_s = {0, -19.9, 0}}).has_value());
  for (const float bad : {0.0f, 3.0f, std::nanf("")})
    EXPECT_FALSE(checked({.orientation = {0, 0, 0, bad}}).has_value()) << bad;
  EXPECT_FALSE(checked({.gripper = std::nanf("")}).has_value());
}

TEST(DeviceChecks, OrientationAndGripperAreBroughtIntoRange) {
  const auto reading = checked({.orientation = {0, 1.5f, 0, 0}, .gripper = 1.3f});
  ASSERT_TRUE(reading.has_value());
  EXPECT_EQ(reading->orientation, (Quatf{0, 1, 0, 0}));
  EXPECT_EQ(reading->gripper, 1.0f);
}

TEST(DeviceChecks, AForceIsFiniteAndWithinTheLimit) {
  EXPECT_EQ(checked_force({0, 2, 0}, 3), (Vec3d{0, 2, 0}));
  EXPECT_NEAR(length(checked_force({3, 4, 0}, 2)), 2, 1e-12);
  EXPECT_EQ(checked_force({kNan, 1, 0}, 3), Vec3d{});
  EXPECT_EQ(checked_force({0, kInfinity, 0}, 3), Vec3d{});
  EXPECT_EQ(checked_force({1e200, 1e200, 0}, 3), Vec3d{});
}

TEST(DeviceChecks, AMatrixAndItsQuaternionTurnAVectorAlike) {
  testing::Random random(7);
  for (int i = 0; i < 200; ++i) {
    const auto part = [&] { return static_cast<float>(random.between(-1, 1)); };
    const Quatf q = normalized(Quatf{part(), part(), part(), part()});
    double rows[3][3];
    for (int column = 0; column < 3; ++column) {
      const Vec3f unit{column == 0 ? 1.0f : 0.0f, column == 1 ? 1.0f : 0.0f,
                       column == 2 ? 1.0f : 0.0f};
      const Vec3f turned = rotate(q, unit);
      rows[0][column] = turned.x, rows[1][column] = turned.y, rows[2][column] = turned.z;
    }
    const auto found = orientation_of(rows);
    ASSERT_TRUE(found.has_value());
    EXPECT_NEAR(length(rotate(*found, {1, 2, 3}) - rotate(q, {1, 2, 3})), 0, 1e-5f);
    rows[1][2] += 0.3;
    EXPECT_FALSE(orientation_of(rows).has_value());
  }
  const double mirror[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, -1}};
  EXPECT_FALSE(orientation_of(mirror).has_value());
  const double broken[3][3] = {{kNan, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  EXPECT_FALSE(orientation_of(broken).has_value());
}

}  // namespace
}  // namespace trocar::device
