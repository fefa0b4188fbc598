#include "client/replica/force_history.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "proto/wire.pb.h"
#include "tests/client/synthetic_source.h"

namespace trocar::replica {
namespace {

ForceHistory::Forces only(int hand, float force_n) {
  ForceHistory::Forces forces{};
  forces[static_cast<std::size_t>(hand)] = force_n;
  return forces;
}
constexpr ParticipantSlot kSecond{1};

TEST(ForceHistory, EmptyIsZero) {
  const ForceHistory history;
  EXPECT_EQ(history.greatest(), 0);
  for (const float force : history.forces(kSecond)) EXPECT_EQ(force, 0);
  for (const float force : history.forces(ParticipantSlot{})) EXPECT_EQ(force, 0);
}

TEST(ForceHistory, KeepsTheGreatestOfABinNewestLast) {
  ForceHistory history;
  for (const float force : {1.0f, 3.0f, 2.0f}) history.add(640, only(1, force));
  history.add(640 + kForceBinTicks, only(1, 0.5f));
  const auto forces = history.forces(kSecond);
  EXPECT_EQ(forces[kForceBins - 1], 0.5f);
  EXPECT_EQ(forces[kForceBins - 2], 3.0f);
  EXPECT_EQ(forces[kForceBins - 3], 0.0f);
  EXPECT_EQ(history.greatest(), 3.0f);
  EXPECT_EQ(history.forces(ParticipantSlot{0})[kForceBins - 1], 0.0f);
}

TEST(ForceHistory, ForgetsAfterTenSecondsHoweverMuchCame) {
  ForceHistory history;
  history.add(0, only(1, 50));
  for (Tick tick = 16; tick < 1'000'000; tick += 16) {
    history.add(tick, only(1, 1));
    if (tick == kForceBinTicks * (kForceBins - 1)) {
      EXPECT_EQ(history.forces(kSecond)[0], 50);
    }
  }
  for (const float force : history.forces(kSecond)) EXPECT_EQ(force, 1);
  EXPECT_EQ(history.greatest(), 1);
  EXPECT_LE(sizeof(ForceHistory), sizeof(float) * kForceBins * kMaxHands + 64);
}

TEST(ForceHistory, WhatNoFrameToldIsAsBeforeForASecondAndALongGapClears) {
  ForceHistory history;
  history.add(0, only(1, 2));
  history.add(5 * kForceBinTicks, only(1, 3));
  auto forces = history.forces(kSecond);
  EXPECT_EQ(forces[kForceBins - 1], 3);
  for (std::size_t i = 2; i <= 6; ++i) EXPECT_EQ(forces[kForceBins - i], 2);
  EXPECT_EQ(forces[kForceBins - 7], 0);
  history.add(45 * kForceBinTicks, only(1, 1));
  forces = history.forces(kSecond);
  EXPECT_EQ(forces[kForceBins - 1], 1);
  for (std::size_t i = 2; i <= 40 - kForceGapBins; ++i) EXPECT_EQ(forces[kForceBins - i], 0) << i;
  for (std::size_t i = 41 - kForceGapBins; i <= 41; ++i) EXPECT_EQ(forces[kForceBins - i], 3) << i;
  history.add(Tick{1} << 50, only(1, 4));
  forces = history.forces(kSecond);
  EXPECT_EQ(forces[kForceBins - 1], 4);
  for (std::size_t i = 0; i + 1 < kForceBins; ++i) EXPECT_EQ(forces[i], 0);
  history.add(3, only(1, 9));  // long past: ignored
  EXPECT_EQ(history.greatest(), 4);
}

TEST(ForceHistory, FollowsAReplicaAndStartsAgainAfterASeek) {
  testing::SyntheticSource source(testing::make_blob_layout(8, 12, 0.08));
  Replica replica([](const proto::Envelope&) { return true; });
  ForceHistory history;
  source.queue_start();
  float most = 0;
  for (int i = 0; i < 300; ++i) {
    source.queue_frame();
    source.poll(replica);
    history.update(replica);
    history.update(replica);  // again: nothing new
    most = std::max(most, forces_of(replica.newest()->tools)[0]);
  }
  EXPECT_GT(most, 1.0f);
  EXPECT_FLOAT_EQ(history.greatest(), most);
  source.queue_frame(true);
  source.tamper = [](proto::Envelope& m) {
    if (m.has_surface_frame()) m.mutable_surface_frame()->set_tick(5);
    if (m.has_frame_state()) m.mutable_frame_state()->clear_tool();
    return true;
  };
  source.poll(replica);
  history.update(replica);
  EXPECT_EQ(history.greatest(), 0);
}

}  // namespace
}  // namespace trocar::replica
