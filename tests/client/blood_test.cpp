// A replica's blood is the server's, level by level, and what is damaged is never shown.

#include <gtest/gtest.h>

#include <algorithm>

#include "client/replica/interpolated_surface.h"
#include "client/replica/replica.h"
#include "proto/wire.pb.h"
#include "tests/client/synthetic_source.h"
#include "tests/support/random.h"

namespace trocar::replica {
namespace {

class BloodTest : public ::testing::Test {
 protected:
  BloodTest() : levels_(source_.layout().vertex_count()) {
    source_.tamper = [this](proto::Envelope& message) {
      if (message.has_surface_frame()) bleed(*message.mutable_surface_frame());
      return true;
    };
    source_.queue_start();
    advance(1);
  }

  void bleed(proto::SurfaceFrame& frame) {
    const auto before = levels_;
    for (int i = 0; i < 20; ++i)
      levels_[random_.below(static_cast<std::uint32_t>(levels_.size()))] =
          static_cast<std::uint8_t>(random_.below(256));
    Bytes payload;
    wire::encode_blood(frame.is_keyframe() ? BytesView() : BytesView(before), levels_, payload);
    if (damages_ && !frame.is_keyframe()) payload[payload.size() / 2] ^= 0x20;
    frame.set_blood(payload.data(), payload.size());
    frame.set_blood_crc(wire::blood_crc(levels_));
  }
  void advance(int frames) {
    for (int i = 0; i < frames; ++i) {
      source_.queue_frame();
      source_.poll(replica_);
    }
  }

  testing::SyntheticSource source_{testing::make_blob_layout(16, 24, 0.08)};
  Replica replica_{[this](const proto::Envelope& message) { return source_.send(message); }};
  testing::Random random_{8};
  wire::BloodLevels levels_;
  bool damages_ = false;
};

TEST_F(BloodTest, IsTheServersToTheLevel) {
  for (int i = 0; i < 100; ++i) {
    advance(1);
    ASSERT_TRUE(replica_.fault().ok());
    ASSERT_EQ(replica_.newest()->blood, levels_);
  }
  const auto last_ack = std::ranges::find_if(source_.sent.rbegin(), source_.sent.rend(),
                                             [](const auto& m) { return m.has_frame_ack(); });
  ASSERT_NE(last_ack, source_.sent.rend());
  EXPECT_EQ(last_ack->frame_ack().blood_crc(), wire::blood_crc(levels_));
}

TEST_F(BloodTest, DamagedLevelsAreNeverShownAndHeal) {
  advance(5);
  damages_ = true;
  for (int i = 0; i < 50; ++i) {
    advance(1);
    if (replica_.sync_state() == SyncState::InStep) {
      ASSERT_EQ(replica_.newest()->blood, levels_) << i;
    }
  }
  damages_ = false;
  advance(3);
  EXPECT_EQ(replica_.newest()->blood, levels_);
  EXPECT_GT(replica_.counters().crc_mismatches, 10u);
  EXPECT_EQ(replica_.counters().healed, replica_.counters().crc_mismatches);
}

TEST_F(BloodTest, IsBetweenTwoFramesWhereThePictureIs) {
  InterpolatedSurface surface;
  surface.update(replica_, 1);
  ASSERT_EQ(surface.blood().size(), levels_.size());
  for (std::size_t i = 0; i < levels_.size(); ++i)
    EXPECT_EQ(surface.blood()[i], static_cast<float>(levels_[i]));
}

}  // namespace
}  // namespace trocar::replica
