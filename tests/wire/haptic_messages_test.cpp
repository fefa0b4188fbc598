#include "common/wire/haptic_messages.h"

#include <gtest/gtest.h>

#include <limits>

#include "proto/wire.pb.h"

namespace trocar::wire {
namespace {

HapticPatch patch() {
  HapticPatch patch;
  patch.tool = 1;
  patch.sequence = 7;
  patch.tick = 1234;
  patch.structure = 3;
  patch.echo_time_us = 5'000'000;
  patch.used_position_m = {0.01f, -0.02f, 0.03f};
  patch.kind = TouchKind::Grip;
  patch.force_n = {0.1f, 0.2f, -0.3f};
  patch.torque_nm = {0.001f, 0, 0};
  patch.plane_point_m = {0, 0, 0.03f};
  patch.plane_normal = {0, 0.6f, 0.8f};
  patch.has_stiffness = true;
  patch.stiffness_n_m = {.xx = 90, .xy = 1, .xz = 2, .yy = 91, .yz = 3, .zz = 120};
  patch.friction = 0.2f;
  patch.pressed_limit_n = 4;
  patch.grip_point_m = {0.01f, 0, 0.02f};
  patch.grip_limit_n = 2;
  patch.cut_force_n = 0.5f;
  patch.side_friction_n = 0.25f;
  patch.law = 2;
  return patch;
}

proto::HapticPatch message() {
  proto::HapticPatch message;
  write(patch(), message);
  return message;
}

TEST(HapticMessages, APatchIsReadAsItWasWritten) {
  const auto read_patch = read(message());
  ASSERT_TRUE(read_patch.ok());
  proto::HapticPatch again;
  write(*read_patch, again);
  EXPECT_EQ(again.SerializeAsString(), message().SerializeAsString());
  EXPECT_EQ(read_patch->stiffness_n_m.xy, 1);
  EXPECT_EQ(read_patch->stiffness_n_m.zz, 120);
  EXPECT_EQ(read_patch->side_friction_n, 0.25f);
  EXPECT_EQ(read_patch->kind, TouchKind::Grip);
}

TEST(HapticMessages, APatchInFreeSpaceIsSmall) {
  HapticPatch free;
  free.echo_time_us = 123'456'789;
  proto::HapticPatch written;
  write(free, written);
  EXPECT_LT(written.ByteSizeLong(), 20u);
  EXPECT_TRUE(read(written).ok());
}

TEST(HapticMessages, APatchOutOfItsLimitsIsRefusedByName) {
  const auto refusal = [](auto change) {
    auto changed = message();
    change(changed);
    const auto result = read(changed);
    return result.ok() ? std::string() : result.error().message;
  };
  constexpr float kNoNumber = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(refusal([](auto& m) { m.set_tool(2); }), "HapticPatch.tool: is over 1");
  EXPECT_EQ(refusal([](auto& m) { m.mutable_force_n()->set_x(kNoNumber); }),
            "HapticPatch.force_n: is over 1000 N");
  EXPECT_EQ(refusal([](auto& m) { m.mutable_force_n()->set_z(-1001); }),
            "HapticPatch.force_n: is over 1000 N");
  EXPECT_EQ(refusal([](auto& m) { m.mutable_plane_normal()->set_z(0); }),
            "HapticPatch.plane_normal: is not of unit length");
  EXPECT_EQ(refusal([](auto& m) { m.mutable_grip_point_m()->set_z(5); }),
            "HapticPatch.position: is over 4 m from the origin");
  EXPECT_EQ(refusal([](auto& m) { m.add_stiffness_n_m(1); }),
            "HapticPatch.stiffness_n_m: has not 6 entries");
  EXPECT_EQ(refusal([](auto& m) { m.set_friction(-1); }),
            "HapticPatch.friction: is not between 0 and 10");
  EXPECT_EQ(refusal([](auto& m) { m.set_cut_force_n(kNoNumber); }),
            "HapticPatch.limit: is negative or over 1000 N");
  EXPECT_EQ(refusal([](auto& m) { m.set_side_friction_n(-1); }),
            "HapticPatch.limit: is negative or over 1000 N");
  EXPECT_EQ(refusal([](auto& m) { m.set_kind(static_cast<proto::TouchKind>(9)); }),
            "HapticPatch.kind: is not known here");
}

HapticLaw liver() {
  HapticLaw law;
  law.number = 1;
  law.exponent = 1.3f;
  law.youngs_modulus_pa = 5300;
  law.relaxation = {{{0.5054f, 0.578f}, {0.1485f, 6.89f}}};
  law.fast = {{{1.2f, 0.002f}, {0.4f, 0.01f}}};
  return law;
}

TEST(HapticMessages, ALawIsReadAsItWasWritten) {
  proto::HapticLaw message;
  write(liver(), message);
  const auto law = read(message);
  ASSERT_TRUE(law.ok());
  proto::HapticLaw again;
  write(*law, again);
  EXPECT_EQ(again.SerializeAsString(), message.SerializeAsString());
  EXPECT_EQ(law->relaxation[1].time_s, 6.89f);
  EXPECT_EQ(law->relaxation[2].share, 0);
}

TEST(HapticMessages, ALawThatNoTissueHasIsRefused) {
  proto::HapticLaw message;
  write(liver(), message);
  auto changed = message;
  changed.add_relaxed_share(0.4f);
  EXPECT_FALSE(read(changed).ok());  // a share without a time
  changed.add_relaxation_time_s(60);
  EXPECT_FALSE(read(changed).ok());  // more than all of the stress
  changed = message;
  changed.set_fast_time_s(0, 0);
  EXPECT_FALSE(read(changed).ok());
  changed = message;
  changed.set_exponent(0.5f);
  EXPECT_FALSE(read(changed).ok());
}

}  // namespace
}  // namespace trocar::wire
