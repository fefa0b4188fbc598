#include "client/device/journal_device.h"

#include <gtest/gtest.h>

namespace trocar::device {
namespace {

replay::RecordedHand recorded() {
  replay::RecordedHand hand;
  hand.name = "Anna";
  hand.shape.radius_m = 0.003f;
  const auto add = [&](Tick tick, float x, tool::Verb verb) {
    hand.samples.push_back({tick, {{x, 0.05f, 0}, rotation_from_z({1, 0, 0})}, verb});
  };
  add(5000, 0.10f, tool::Verb::Push);
  add(5100, 0.11f, tool::Verb::Grasp);
  add(5200, 0.11f, tool::Verb::Cut);
  add(5300, 0.12f, tool::Verb::None);
  add(5400, 0.12f, tool::Verb::Grasp);
  return hand;
}

TEST(JournalDevice, IsWhereTheRecordedHandWas) {
  std::uint64_t now_us = 77'000'000;
  JournalDevice device(recorded(), [&] { return now_us; });
  EXPECT_EQ(device.description(), "recorded hand of Anna");
  const auto own = device.own_tool();
  ASSERT_TRUE(own.has_value());
  EXPECT_EQ(own->shape.radius_m, 0.003f);
  EXPECT_NEAR(own->start_m.x, 0.10, 1e-7);
  // It begins with the first look, however long that took.
  now_us += 3'000'000;
  const auto first = device.read();
  ASSERT_TRUE(first.ok());
  EXPECT_EQ(first->time_us, now_us);
  EXPECT_NEAR(first->position_m.x, 0.10, 1e-7);
  EXPECT_NEAR(first->position_m.y, 0.05, 1e-7);
  EXPECT_NEAR(length(rotate(first->orientation, {0, 0, 1}) - Vec3f{1, 0, 0}), 0, 1e-6);
  now_us += 50'000;
  const auto between = device.read();
  EXPECT_NEAR(between->position_m.x, 0.105, 1e-7);
  EXPECT_NEAR(between->velocity_m_s.x, 0.1, 1e-3);
  EXPECT_TRUE(device.write({1, 2, 3}, {}).ok());
  EXPECT_EQ(device.read()->position_m, between->position_m) << "a force moves nothing";
}

TEST(JournalDevice, ItsVerbsAreGripperAndButtons) {
  std::uint64_t now_us = 1000;
  JournalDevice device(recorded(), [&] { return now_us; });
  const auto after = [&](std::uint64_t ms) {
    now_us = 1000 + ms * 1000;
    return *device.read();
  };
  EXPECT_EQ(after(0).gripper, 0);
  EXPECT_EQ(after(0).buttons, 0u);
  EXPECT_EQ(after(150).gripper, 1);
  EXPECT_EQ(after(250).gripper, 0);
  EXPECT_EQ(after(250).buttons, 2u);
  EXPECT_EQ(after(350).buttons, kRestsButton);
  EXPECT_EQ(after(400).gripper, 1);
  const auto over = after(10'000);
  EXPECT_EQ(over.buttons, kRestsButton) << "its end";
  EXPECT_EQ(over.gripper, 0);
  EXPECT_NEAR(over.position_m.x, 0.12, 1e-7);
}

}  // namespace
}  // namespace trocar::device
