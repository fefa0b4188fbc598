#include "client/replica/replica.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "client/replica/client_messages.h"
#include "common/wire/surface_codec.h"
#include "proto/wire.pb.h"
#include "tests/client/synthetic_source.h"

namespace trocar::replica {
namespace {

class ReplicaTest : public ::testing::Test {
 protected:
  void start() {
    source_.queue_start();
    advance(1);
  }
  void advance(int frames) {
    for (int i = 0; i < frames; ++i) {
      source_.queue_frame();
      source_.poll(replica_);
    }
  }
  int sent_requests() const {
    return static_cast<int>(std::ranges::count_if(
        source_.sent, [](const auto& m) { return m.has_keyframe_request(); }));
  }
  void expect_in_step() {
    ASSERT_TRUE(replica_.fault().ok()) << replica_.fault().error().message;
    EXPECT_EQ(replica_.sync_state(), SyncState::InStep);
    ASSERT_NE(replica_.newest(), nullptr);
    EXPECT_EQ(replica_.newest()->frame, source_.frame());
    EXPECT_EQ(replica_.newest()->surface, source_.surface());
  }

  testing::SyntheticSource source_{testing::make_blob_layout(16, 24, 0.08)};
  Replica replica_{[this](const proto::Envelope& message) { return source_.send(message); }};
};

TEST_F(ReplicaTest, FollowsTheServerBitForBit) {
  start();
  for (int i = 0; i < 100; ++i) {
    advance(1);
    expect_in_step();
  }
  EXPECT_EQ(replica_.counters().frames, 101u);
  EXPECT_EQ(replica_.counters().keyframes, 1u);
  EXPECT_EQ(replica_.counters().crc_mismatches, 0u);
  EXPECT_EQ(replica_.history().size(), kHistoryFrames);
  EXPECT_GT(replica_.counters().changed_vertices, 0u);
  EXPECT_GT(replica_.share_moved(), 0.0);
  EXPECT_LT(replica_.share_moved(), 1.0);
  EXPECT_EQ(replica_.told().participants().size(), 4u);
  EXPECT_EQ(replica_.own_slot().value, 2);
  EXPECT_EQ(replica_.newest()->regions.size(), source_.surface().size());
  EXPECT_EQ(replica_.newest()->tools.size(), 2u);
}

TEST_F(ReplicaTest, AcknowledgesEveryFrame) {
  start();
  advance(63);
  const auto acks =
      std::ranges::count_if(source_.sent, [](const auto& m) { return m.has_frame_ack(); });
  EXPECT_EQ(acks, 64);
}

TEST_F(ReplicaTest, CorruptedDeltaIsNeverShownAndHealsWithOneRequest) {
  start();
  advance(10);
  source_.answer_requests = false;
  replica_.corrupt_delta(11);
  const auto before = replica_.newest()->surface;
  const Frame frame_before = replica_.newest()->frame;
  advance(20);
  EXPECT_EQ(replica_.sync_state(), SyncState::Healing);
  EXPECT_EQ(replica_.counters().crc_mismatches, 1u);
  EXPECT_EQ(replica_.counters().deltas_ignored, 19u);
  EXPECT_EQ(replica_.newest()->frame, frame_before);
  EXPECT_EQ(replica_.newest()->surface, before);
  EXPECT_EQ(sent_requests(), 1);
  source_.queue_frame(true);
  source_.poll(replica_);
  expect_in_step();
  EXPECT_EQ(replica_.counters().healed, 1u);
  advance(5);
  expect_in_step();
  EXPECT_EQ(sent_requests(), 1);
}

TEST_F(ReplicaTest, NoDamagedDeltaIsEverShown) {
  start();
  advance(3);
  std::size_t at = 0, deltas = 0;
  source_.tamper = [&](proto::Envelope& message) {
    if (message.has_surface_frame() && !message.surface_frame().is_keyframe()) {
      auto& payload = *message.mutable_surface_frame()->mutable_payload();
      payload[at++ % payload.size()] ^= 0x40;
      ++deltas;
    }
    return true;
  };
  for (int i = 0; i < 200; ++i) {
    advance(1);
    if (replica_.sync_state() != SyncState::InStep) continue;
    ASSERT_EQ(replica_.newest()->surface, source_.surface()) << "frame " << i;
  }
  source_.tamper = nullptr;
  advance(2);
  expect_in_step();
  // A flipped bit of the padding changes nothing and may pass; nearly all others must be found.
  EXPECT_GE(deltas, 100u);
  EXPECT_GE(replica_.counters().crc_mismatches, 95u);
  EXPECT_EQ(replica_.counters().healed, replica_.counters().crc_mismatches);
}

TEST_F(ReplicaTest, LostDeltaIsNoticedByItsBase) {
  start();
  advance(5);
  bool drop = true;
  source_.tamper = [&](proto::Envelope& message) {
    return !(message.has_surface_frame() && std::exchange(drop, false));
  };
  advance(2);
  EXPECT_EQ(replica_.counters().base_mismatches, 1u);
  EXPECT_EQ(sent_requests(), 1);
  advance(2);
  expect_in_step();
  EXPECT_EQ(replica_.counters().healed, 1u);
}

TEST_F(ReplicaTest, RequestThatCouldNotBeQueuedIsTriedAgain) {
  int attempts = 0;
  Replica replica([&](const proto::Envelope& message) {
    return message.has_keyframe_request() ? ++attempts > 3 : true;
  });
  source_.queue_start();
  replica.corrupt_delta(1);
  for (int i = 0; i < 10; ++i) {
    source_.queue_frame();
    source_.poll(replica);
  }
  EXPECT_EQ(attempts, 4);
}

TEST_F(ReplicaTest, BarrierIsAnsweredWithOwnCrcAlsoAfterHealing) {
  start();
  advance(4);
  replica_.corrupt_delta(5);
  source_.queue_frame();
  proto::Envelope barrier;
  barrier.mutable_barrier()->set_frame(source_.frame());
  barrier.mutable_barrier()->set_surface_crc(wire::surface_crc(source_.surface()));
  source_.queue(barrier);
  source_.poll(replica_);
  const auto acks = [&] {
    return std::ranges::count_if(source_.sent, [](const auto& m) { return m.has_frame_ack(); });
  };
  const auto before = acks();
  EXPECT_EQ(source_.sent.back().message_case(), proto::Envelope::kKeyframeRequest);
  // The server answers the request with a keyframe of the same, last frame.
  proto::Envelope keyframe;
  auto& frame = *keyframe.mutable_surface_frame();
  frame.set_frame(source_.frame());
  frame.set_tick(source_.frame() * kTicksPerFrame);
  frame.set_epoch(1);
  frame.set_is_keyframe(true);
  frame.set_surface_crc(wire::surface_crc(source_.surface()));
  Bytes payload;
  wire::encode_keyframe(source_.surface(), payload);
  frame.set_payload(payload.data(), payload.size());
  source_.queue(keyframe);
  source_.poll(replica_);
  ASSERT_GT(acks(), before);
  EXPECT_EQ(source_.sent.back().frame_ack().frame(), source_.frame());
  EXPECT_EQ(source_.sent.back().frame_ack().surface_crc(), wire::surface_crc(source_.surface()));
  ASSERT_TRUE(replica_.barrier().has_value());
  EXPECT_EQ(replica_.barrier()->own_crc, replica_.barrier()->server_crc);
}

TEST_F(ReplicaTest, KeyframeMayGoBackInTime) {
  start();
  const auto early = source_.surface();
  proto::Envelope back;
  auto& frame = *back.mutable_surface_frame();
  frame.set_frame(1), frame.set_tick(16), frame.set_epoch(1), frame.set_is_keyframe(true);
  frame.set_surface_crc(wire::surface_crc(early));
  Bytes payload;
  wire::encode_keyframe(early, payload);
  frame.set_payload(payload.data(), payload.size());
  advance(30);
  const auto version = replica_.history_version();
  source_.queue(back);
  source_.poll(replica_);
  EXPECT_EQ(replica_.history().size(), 1u);
  EXPECT_GT(replica_.history_version(), version);
  EXPECT_EQ(replica_.newest()->surface, early);
}

TEST_F(ReplicaTest, ToolSamplesCarryPoseAndVerb) {
  const tool::ToolSample sample{{{0.1f, -0.2f, 0.3f}, {0, 0.6f, 0, 0.8f}}, tool::Verb::Grasp};
  ASSERT_TRUE(send_tool_sample(source_, 1, 7, sample));
  const auto& message = source_.sent.back().tool_sample();
  EXPECT_EQ(message.tool(), 1u);
  EXPECT_EQ(message.sequence(), 7u);
  EXPECT_EQ(message.position_m().y(), -0.2f);
  EXPECT_EQ(message.orientation().w(), 0.8f);
  EXPECT_EQ(message.verb(), proto::VERB_GRASP);
}

TEST_F(ReplicaTest, WhatTheRateControllerDecidedIsKept) {
  start();
  wire::RateFigures expected;
  expected.level = wire::RateLevel::Reduced;
  expected.budget_us = 800;
  expected.predicted_us = 742;
  expected.lowered = 12;
  expected.raised = 7;
  EXPECT_EQ(replica_.newest()->figures.pace.rate, expected);
  EXPECT_EQ(replica_.newest()->figures.solve.layer_sweeps, (wire::LayerCounts{4, 3, 2, 1}));
  EXPECT_EQ(replica_.newest()->figures.near.node_limit, 1050u);

  // A level of a newer server is as if nothing were known of it; the rest counts.
  source_.tamper = [](proto::Envelope& m) {
    if (m.has_frame_state())
      m.mutable_frame_state()->mutable_rate()->set_level(static_cast<proto::RateLevel>(9));
    return true;
  };
  advance(1);
  expected.level = wire::RateLevel::Fixed;
  EXPECT_EQ(replica_.newest()->figures.pace.rate, expected);

  source_.tamper = [](proto::Envelope& m) {
    if (m.has_frame_state()) m.mutable_frame_state()->clear_rate();
    return true;
  };
  advance(1);
  EXPECT_EQ(replica_.newest()->figures.pace.rate, wire::RateFigures{});  // a server before 1.2
  EXPECT_TRUE(replica_.fault().ok());
}

TEST_F(ReplicaTest, WhatHasRelaxedIsKept) {
  start();
  EXPECT_FALSE(replica_.newest()->figures.relaxation) << "nothing relaxes";
  source_.tamper = [](proto::Envelope& m) {
    if (!m.has_frame_state()) return true;
    auto& relaxation = *m.mutable_frame_state()->mutable_relaxation();
    relaxation.set_energy_j(0.0125);
    relaxation.set_volume_change(-0.002f);
    relaxation.set_relaxed_share(0.4f);
    return true;
  };
  advance(1);
  EXPECT_EQ(replica_.newest()->figures.relaxation,
            (wire::RelaxationFigures{0.0125, -0.002f, 0.4f}));
  source_.tamper = nullptr;
  advance(1);
  EXPECT_FALSE(replica_.newest()->figures.relaxation);
  EXPECT_TRUE(replica_.fault().ok());
}

wire::FineSurface fine_triangle() {
  wire::FineSurface fine;
  for (const std::int32_t q : {0, 20'000, 40'000}) fine.quanta.push_back({q, q * q % 997, 0});
  fine.triangles.push_back({0, 1, 2});
  return fine;
}

TEST_F(ReplicaTest, AFineSurfaceIsThereOnceItIsWhole) {
  start();
  EXPECT_EQ(replica_.fine_surface(), nullptr);
  auto fine = fine_triangle();
  fine.texture.resize(3);
  fine.picture = "\x89PNG\r\n\x1a\n" + std::string(wire::kFinePartBytes, 'x');
  const auto give = [&] {
    for (const auto& part : wire::parts_of(fine)) {
      proto::Envelope envelope;
      *envelope.mutable_fine_surface_part() = part;
      replica_.on_message(envelope, 0, 100);
      advance(1);
    }
  };
  give();
  ASSERT_NE(replica_.fine_surface(), nullptr);
  EXPECT_EQ(*replica_.fine_surface(), fine);
  expect_in_step();
  // Who comes back is sent it again, which is not another one.
  const auto* before = replica_.fine_surface().get();
  give();
  EXPECT_EQ(replica_.fine_surface().get(), before);
}

TEST_F(ReplicaTest, AFineSurfaceThatIsNoneIsAFault) {
  start();
  auto parts = wire::parts_of(fine_triangle());
  parts[0].mutable_payload()->push_back('\xff');
  proto::Envelope envelope;
  *envelope.mutable_fine_surface_part() = parts[0];
  replica_.on_message(envelope, 0, 100);
  ASSERT_FALSE(replica_.fault().ok());
  EXPECT_NE(replica_.fault().error().message.find("FineSurfacePart.payload"), std::string::npos);
}

TEST_F(ReplicaTest, InvalidMessagesAreAFaultThatNamesTheField) {
  const auto fault_of = [&](auto change) {
    testing::SyntheticSource source(testing::make_blob_layout(6, 8, 0.08));
    source.tamper = [&](proto::Envelope& message) {
      change(message);
      return true;
    };
    Replica replica([](const proto::Envelope&) { return true; });
    source.queue_start();
    source.queue_frame();
    source.queue_frame();
    source.poll(replica);
    return replica.fault().ok() ? std::string() : replica.fault().error().message;
  };
  EXPECT_EQ(fault_of([](proto::Envelope&) {}), "");
  EXPECT_NE(fault_of([](proto::Envelope& m) {
              if (m.has_surface_topology()) m.mutable_surface_topology()->set_triangle(4, 9999);
            }).find("SurfaceTopology.triangle"),
            std::string::npos);
  EXPECT_NE(fault_of([](proto::Envelope& m) {
              if (m.has_surface_topology())
                m.mutable_surface_topology()->add_rest_position_quanta(1);
            }).find("rest_position_quanta"),
            std::string::npos);
  EXPECT_NE(fault_of([](proto::Envelope& m) {
              if (m.has_frame_state()) m.mutable_frame_state()->add_region_runs(1);
            }).find("region_runs"),
            std::string::npos);
  EXPECT_NE(fault_of([](proto::Envelope& m) {
              if (m.has_frame_state()) m.mutable_frame_state()->mutable_tool(0)->set_tool(77);
            }).find("FrameState.tool"),
            std::string::npos);
  const auto rate_fault = [&](auto change) {
    return fault_of([&](proto::Envelope& m) {
      if (m.has_frame_state()) change(*m.mutable_frame_state()->mutable_rate());
    });
  };
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  for (const float bad : {std::nanf(""), kInfinity, -1.0f}) {
    for (const auto& fault : {rate_fault([&](proto::RateState& r) { r.set_time_rate(bad); }),
                              rate_fault([&](proto::RateState& r) { r.set_budget_us(bad); }),
                              rate_fault([&](proto::RateState& r) { r.set_predicted_us(bad); })})
      EXPECT_NE(fault.find("FrameState.rate"), std::string::npos) << bad;
  }
  EXPECT_NE(rate_fault([](proto::RateState& r) {
              for (int i = 0; i < 20; ++i) r.add_layer_sweeps(1);
            }).find("FrameState.rate"),
            std::string::npos);
  EXPECT_NE(fault_of([&](proto::Envelope& m) {
              if (m.has_frame_state())
                m.mutable_frame_state()->mutable_relaxation()->set_volume_change(kInfinity);
            }).find("FrameState.relaxation"),
            std::string::npos);
  EXPECT_NE(fault_of([](proto::Envelope& m) {
              if (m.has_welcome()) m.mutable_welcome()->set_protocol_major(9);
            }).find("protocol 9"),
            std::string::npos);
}

TEST_F(ReplicaTest, ASecondWelcomeBeginsAnewAndKeepsThePictureUntilTheKeyframe) {
  start();
  advance(10);
  source_.answer_requests = false;
  replica_.corrupt_delta(11);
  advance(5);
  ASSERT_EQ(replica_.sync_state(), SyncState::Healing) << "what it asked for is lost";
  const auto shown = replica_.newest()->surface;
  const auto version = replica_.topology_version();
  source_.queue_start();
  source_.poll(replica_);
  EXPECT_EQ(replica_.welcome_count(), 2u);
  ASSERT_NE(replica_.newest(), nullptr);
  EXPECT_EQ(replica_.newest()->surface, shown);
  EXPECT_EQ(replica_.topology_version(), version);
  EXPECT_EQ(replica_.sync_state(), SyncState::WaitingForKeyframe);
  advance(1);
  expect_in_step();
  EXPECT_EQ(replica_.history().size(), 1u);
  EXPECT_EQ(replica_.counters().healed, 0u) << "it was told everything anew";
  advance(30);
  expect_in_step();
  EXPECT_EQ(replica_.counters().keyframes, 2u);
}

TEST_F(ReplicaTest, KeepsWhoIsAway) {
  start();
  proto::Envelope message;
  auto& entry = *message.mutable_participants()->add_participant();
  entry.set_slot(1);
  entry.set_is_away(true);
  replica_.on_message(message, 0, 0);
  ASSERT_EQ(replica_.told().participants().size(), 1u);
  EXPECT_TRUE(replica_.told().participants()[0].is_away);
}

TEST_F(ReplicaTest, APointerStaysAsLongAsThereIsNewsOfIt) {
  proto::Envelope message;
  message.mutable_point_event()->set_participant(17);
  message.mutable_point_event()->mutable_position_m()->set_y(0.02f);
  constexpr std::uint64_t kNow = 5'000'000'000;
  replica_.on_message(message, kNow, 20);
  replica_.on_message(message, kNow + 1, 20);
  ASSERT_EQ(replica_.told().pointers(kNow + 2).size(), 1u);
  EXPECT_EQ(replica_.told().pointers(kNow + 2)[0].participant.value, 17);
  EXPECT_FLOAT_EQ(replica_.told().pointers(kNow + 2)[0].position_m.y, 0.02f);
  EXPECT_TRUE(replica_.told().pointers(kNow + 1 + kPointerNs).empty());
  message.mutable_point_event()->clear_position_m();
  replica_.on_message(message, kNow + 2, 20);
  EXPECT_TRUE(replica_.told().pointers(kNow + 2).empty());
  message.mutable_point_event()->set_participant(kMaxParticipants);
  replica_.on_message(message, kNow + 3, 20);
  EXPECT_FALSE(replica_.fault().ok());
}

TEST_F(ReplicaTest, KeepsWhatTheServerSaysOfItsRecording) {
  start();
  EXPECT_EQ(replica_.told().recording().status, wire::RecordingStatus::Unknown);
  proto::Envelope message;
  auto& state = *message.mutable_recording_state();
  state.set_status(proto::RECORDING_GAPPED);
  state.set_frames_missing(7);
  state.set_text(std::string(1000, 'x'));
  replica_.on_message(message, 0, 0);
  advance(100);
  EXPECT_TRUE(replica_.told().recording().is_damaged()) << "it stays, whatever comes";
  EXPECT_EQ(replica_.told().recording().frames_missing, 7u);
  EXPECT_EQ(replica_.told().recording().text.size(), kMaxRecordingText);
  state.set_status(static_cast<proto::RecordingStatus>(77));
  replica_.on_message(message, 0, 0);
  EXPECT_EQ(replica_.told().recording().status, wire::RecordingStatus::Unknown);
  EXPECT_TRUE(replica_.fault().ok());
}

}  // namespace
}  // namespace trocar::replica
