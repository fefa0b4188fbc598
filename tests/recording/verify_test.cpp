// Verification of recordings: what is sound is verified, whatever was changed afterwards is found
// and named, and what could not be checked is never called verified.

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "common/base/checksum.h"
#include "common/base/exit_code.h"
#include "common/journal/session_journal.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/recording/verify.h"
#include "tests/recording/recorded_simulation.h"
#include "tests/support/files.h"
#include "tests/support/program_fixture.h"

namespace trocar::recording::testing {
namespace {

using trocar::testing::load_file;
using trocar::testing::save_file;
using trocar::testing::TemporaryFolder;

constexpr Tick kFrameTick = 1200;  // hands press, hold and cut

class Verify : public trocar::testing::ProgramFixture {
 protected:
  Verify() : ProgramFixture("trocar-journal") {}

  VerifyReport verify(const std::string& path) {
    auto report = verify_journal(path);
    EXPECT_TRUE(report.ok()) << report.error().message;
    return report.ok() ? std::move(*report) : VerifyReport{};
  }
  VerifyReport verify_copy(const Edit& edit, std::uint32_t sim_version = kSimVersion) {
    const auto copy = at("copy.mcap");
    std::filesystem::remove(copy);
    copy_journal(recorded_simulation(), copy, edit, sim_version);
    return verify(copy);
  }
  // Changes the message of this kind in the frame of `kFrameTick`.
  template <typename Message, typename Change>
  VerifyReport verify_changed(std::string_view topic, Change change) {
    bool is_changed = false;
    auto report = verify_copy([&](std::string_view of, google::protobuf::Message& message) {
      if (of != topic || is_changed) return true;
      is_changed = change(static_cast<Message&>(message));
      return true;
    });
    EXPECT_TRUE(is_changed) << topic;
    return report;
  }
  void expect_difference(const VerifyReport& report, Tick tick, const std::string& channel,
                         const std::string& field) {
    EXPECT_EQ(report.verdict(), Verdict::Different);
    ASSERT_TRUE(report.first_difference);
    EXPECT_EQ(report.first_difference->tick, tick) << report.first_difference->text();
    EXPECT_EQ(report.first_difference->channel, channel) << report.first_difference->text();
    EXPECT_NE(report.first_difference->field.find(field), std::string::npos)
        << report.first_difference->text();
    EXPECT_NE(report.first_difference->recorded, report.first_difference->simulated);
  }
  void expect_reason(const VerifyReport& report, const std::string& says) {
    EXPECT_EQ(report.verdict(), Verdict::NotVerified)
        << (report.first_difference ? report.first_difference->text() : "");
    std::string all;
    for (const auto& reason : report.reasons) all += reason + "\n";
    EXPECT_NE(all.find(says), std::string::npos) << all;
  }
  std::string save(const char* name, BytesView bytes) {
    save_file(at(name), bytes);
    return at(name);
  }
  // Exit code of trocar-journal verify; what it says is in log().
  int exit_code(const std::string& path, bool as_json = false) {
    return as_json ? run({"verify", path, "--json"}) : run({"verify", path});
  }
};

TEST_F(Verify, ASoundRecordingIsVerifiedWhole) {
  const auto report = verify(recorded_simulation());
  std::string all;
  for (const auto& reason : report.reasons) all += reason + "\n";
  EXPECT_EQ(report.verdict(), Verdict::Verified)
      << (report.first_difference ? report.first_difference->text() : all);
  EXPECT_TRUE(report.is_resimulated);
  EXPECT_EQ(report.first_tick, 1u);
  EXPECT_EQ(report.last_tick, kRecordedTicks);
  EXPECT_EQ(report.ticks_verified, kRecordedTicks);
  EXPECT_EQ(report.ticks_missing, 0u);
  constexpr auto kFrames = kRecordedTicks / kTicksPerFrame;
  EXPECT_EQ(report.frames_verified, kFrames);
  // The first frame is a keyframe; later each second adds a keyframe beside the delta.
  EXPECT_EQ(report.surfaces_verified, kFrames + 2);
  EXPECT_EQ(report.surfaces_decoded, report.surfaces_verified);
  EXPECT_EQ(report.snapshots_verified, 1 + std::size(kSnapshotTicks));
  EXPECT_EQ(report.snapshots_continued, report.snapshots_verified);
  EXPECT_GT(report.participants_verified, 0u);
  EXPECT_EQ(report.damaged_chunks, 0u);
  EXPECT_EQ(exit_code(recorded_simulation()), 0);
  EXPECT_NE(log().find("verified to tick 2400"), std::string::npos) << log();
  EXPECT_EQ(exit_code(recorded_simulation(), true), 0);
  EXPECT_NE(log().find("\"verified\": true"), std::string::npos) << log();
}

TEST_F(Verify, ACopyWithoutChangesIsVerified) {
  EXPECT_EQ(verify_copy([](auto, auto&) { return true; }).verdict(), Verdict::Verified);
}

// ---- differences: exit code 1 ----

TEST_F(Verify, AFlippedByteOfAStateIsFound) {
  auto report = verify_changed<proto::WorldSnapshot>("/world/snapshot", [](auto& snapshot) {
    if (snapshot.tick() != kSnapshotTicks[0]) return false;
    auto& state = *snapshot.mutable_state();
    state[state.size() / 2] = static_cast<char>(state[state.size() / 2] ^ 1);
    const auto bytes = bytes_of(std::string_view(state));
    snapshot.set_state_hash(xxh3_64(bytes));
    return true;
  });
  expect_difference(report, kSnapshotTicks[0], "/world/snapshot", "byte ");
  // And where its own hash does not follow.
  report = verify_changed<proto::WorldSnapshot>("/world/snapshot", [](auto& snapshot) {
    (*snapshot.mutable_state())[100] ^= 1;
    return true;
  });
  expect_difference(report, 0, "/world/snapshot", "hash of state");
}

TEST_F(Verify, AChangedHashIsFound) {
  const auto report = verify_changed<proto::TickBatch>("/tick_batch", [](auto& batch) {
    auto& record = *batch.mutable_record(3);
    if (record.tick() < kFrameTick) return false;
    record.set_state_hash(record.state_hash() ^ 1);
    return true;
  });
  expect_difference(report, kFrameTick + 4, "/tick_batch", "state_hash");
  EXPECT_EQ(report.ticks_verified, kFrameTick + 3);
}

TEST_F(Verify, AChangedSampleIsFound) {
  Tick changed = 0;
  const auto report = verify_changed<proto::TickBatch>("/tick_batch", [&](auto& batch) {
    for (auto& record : *batch.mutable_record()) {
      if (record.tick() < kFrameTick || record.sample_size() == 0) continue;
      auto& at = *record.mutable_sample(0)->mutable_position_m();
      at.set_x(std::nextafter(at.x(), 1.0f));
      changed = record.tick();
      return true;
    }
    return false;
  });
  expect_difference(report, changed, "/tick_batch", "state_hash");
}

TEST_F(Verify, AChangedForceTorqueOrProxyIsFoundWithBothValues) {
  const auto in_frame = [&](auto change) {
    return verify_changed<proto::FrameState>("/frame_state", [&](auto& state) {
      return state.tick() == kFrameTick && (change(*state.mutable_tool(0)), true);
    });
  };
  const auto force = in_frame([](auto& tool) { tool.mutable_force_n()->set_y(12.5f); });
  expect_difference(force, kFrameTick, "/frame_state", "tool[0].force_n.y");
  EXPECT_EQ(force.first_difference->recorded, "12.5");
  expect_difference(in_frame([](auto& tool) { tool.mutable_torque_nm()->set_z(0.5f); }), kFrameTick,
                    "/frame_state", "tool[0].torque_nm.z");
  expect_difference(in_frame([](auto& tool) { tool.mutable_proxy_position_m()->set_x(0.123f); }),
                    kFrameTick, "/frame_state", "tool[0].proxy_position_m");
  expect_difference(in_frame([](auto& tool) { tool.set_has_claim(!tool.has_claim()); }), kFrameTick,
                    "/frame_state", "tool[0].has_claim");
  EXPECT_EQ(exit_code(at("copy.mcap")), 1);
  EXPECT_NE(log().find("first difference: tick 1200, /frame_state: tool[0].has_claim"),
            std::string::npos)
      << log();
  EXPECT_EQ(exit_code(at("copy.mcap"), true), 1);
  EXPECT_NE(log().find("\"verdict\": \"different\""), std::string::npos) << log();
}

TEST_F(Verify, MeasuredTimesMayBeWhatTheyWere) {
  const auto report = verify_changed<proto::FrameState>("/frame_state", [](auto& state) {
    state.set_tick_cpu_us(123);
    state.set_slow_ticks(7);
    state.mutable_rate()->set_time_rate(0.5f);
    return true;
  });
  EXPECT_EQ(report.verdict(), Verdict::Verified);
}

TEST_F(Verify, AChangedToolChannelIsFound) {
  int seen = 0;
  const auto report = verify_changed<proto::ToolState>("/tool/2", [&](auto& tool) {
    if (++seen < 10) return false;
    tool.mutable_force_n()->set_x(3);
    return true;
  });
  EXPECT_EQ(report.verdict(), Verdict::Different);
  ASSERT_TRUE(report.first_difference);
  EXPECT_EQ(report.first_difference->channel, "/tool/2");
  EXPECT_EQ(report.first_difference->field, "force_n.x");
}

TEST_F(Verify, AChangedClaimIsFound) {
  const auto report = verify_changed<proto::ClaimLog>("/claims", [](auto& log) {
    log.mutable_event(0)->set_outcome(proto::CLAIM_TAKEN_OVER);
    return true;
  });
  EXPECT_EQ(report.verdict(), Verdict::Different);
  ASSERT_TRUE(report.first_difference);
  EXPECT_EQ(report.first_difference->channel, "/claims");
  EXPECT_NE(report.first_difference->field.find("outcome"), std::string::npos);
}

TEST_F(Verify, ChangedParticipantsAreFound) {
  const auto report = verify_changed<proto::Participants>("/participants", [](auto& list) {
    list.mutable_participant(1)->mutable_tool(0)->set_radius_m(0.009f);
    return true;
  });
  expect_difference(report, 1008, "/participants", "slot 1, tool 0");
  const auto left = verify_changed<proto::Participants>("/participants", [](auto& list) {
    list.mutable_participant()->RemoveLast();
    return true;
  });
  EXPECT_EQ(left.verdict(), Verdict::Different);
}

TEST_F(Verify, AChangedSurfaceIsFound) {
  const auto of_frame = [&](auto change) {
    return verify_changed<proto::SurfaceFrame>("/surface/delta", [&](auto& frame) {
      return frame.tick() == kFrameTick && (change(frame), true);
    });
  };
  expect_difference(of_frame([](auto& frame) { frame.set_surface_crc(frame.surface_crc() ^ 1); }),
                    kFrameTick, "/surface/delta", "surface_crc");
  expect_difference(of_frame([](auto& frame) { (*frame.mutable_payload())[5] ^= 1; }), kFrameTick,
                    "/surface/delta", "");
  const auto change = verify_changed<proto::SurfaceChange>("/topology/change", [](auto& message) {
    message.set_triangle_sum(message.triangle_sum() ^ 1);
    return true;
  });
  EXPECT_EQ(change.verdict(), Verdict::Different);
}

// ---- what cannot be verified: exit code 6 ----

TEST_F(Verify, ARemovedBatchIsMissed) {
  const auto report = verify_copy([](std::string_view topic, auto& message) {
    return topic != "/tick_batch" ||
           static_cast<proto::TickBatch&>(message).record(0).tick() != kFrameTick + 1;
  });
  expect_reason(report, "ticks 1201 to 1216");
  EXPECT_EQ(report.ticks_missing, 16u);
  EXPECT_LT(report.ticks_verified, report.last_tick);
  EXPECT_EQ(report.ticks_verified, kFrameTick + kRecordedTicks - kSnapshotTicks[1])
      << "it goes on from the next snapshot";
  EXPECT_EQ(exit_code(at("copy.mcap")), static_cast<int>(ExitCode::NotVerified));
  EXPECT_EQ(exit_code(at("copy.mcap"), true), 6);
  EXPECT_NE(log().find("\"verified\": false"), std::string::npos) << log();
  EXPECT_NE(log().find("\"ticks_missing\": 16"), std::string::npos) << log();
}

TEST_F(Verify, EveryKindOfRemovedMessageIsMissed) {
  for (const std::string_view removed :
       {"/frame_state", "/claims", "/surface/delta", "/surface/key", "/topology/change", "/tool/0",
        "/topology"}) {
    bool is_removed = false;
    const auto report = verify_copy([&](std::string_view topic, auto&) {
      if (topic != removed || is_removed) return true;
      is_removed = true;
      return false;
    });
    EXPECT_TRUE(is_removed) << removed;
    expect_reason(report, "a message on " + std::string(removed) + " is missing");
  }
}

TEST_F(Verify, ADamagedChunkIsNamed) {
  auto journal = journal::SessionJournal::open(recorded_simulation());
  ASSERT_TRUE(journal.ok());
  const auto& chunks = (*journal)->container().chunks();
  ASSERT_GT(chunks.size(), 6u);
  auto bytes = load_file(recorded_simulation());
  const auto& chunk = chunks[chunks.size() / 2];
  bytes[chunk.chunk_offset + chunk.chunk_length / 2] ^= 0x40;
  const auto path = save("damaged.mcap", bytes);
  const auto report = verify(path);
  expect_reason(report, "1 damaged chunks");
  EXPECT_EQ(report.damaged_chunks, 1u);
  EXPECT_GT(report.ticks_missing, 0u);
  EXPECT_EQ(exit_code(path), 6);
}

TEST_F(Verify, DamageInWhatTheTicksDoNotNeedIsNamed) {
  auto journal = journal::SessionJournal::open(recorded_simulation());
  ASSERT_TRUE(journal.ok());
  const auto& chunk = (*journal)->container().chunks().front();
  ASSERT_GE(chunk.message_index_length, 16u);
  auto bytes = load_file(recorded_simulation());
  bytes[chunk.chunk_offset + chunk.chunk_length + chunk.message_index_length - 4] ^= 0x5a;
  const auto path = save("damaged_index.mcap", bytes);
  const auto report = verify(path);
  expect_reason(report, "the CRC of all data does not match");
  EXPECT_EQ(report.damaged_chunks, 0u);
  EXPECT_EQ(exit_code(path), 6);
}

TEST_F(Verify, AGapIsNamed) {
  const auto path = at("gapped.mcap");
  record_simulation(path, 1216);
  const auto report = verify(path);
  expect_reason(report, "ticks 1201 to 1216: a marked gap");
  EXPECT_EQ(report.ticks_missing, 16u);
  EXPECT_EQ(report.ticks_verified, 1200 + kRecordedTicks - kSnapshotTicks[1]);
  EXPECT_EQ(report.surfaces_decoded, kRecordedTicks / kTicksPerFrame - 1 + 2)
      << "a keyframe beside the delta each second";
}

TEST_F(Verify, AMissingEndIsNamed) {
  auto bytes = load_file(recorded_simulation());
  bytes.resize(bytes.size() * 2 / 3);
  const auto path = save("cut.mcap", bytes);
  const auto report = verify(path);
  expect_reason(report, "it has no end: unfinished recording: ");
  EXPECT_GT(report.ticks_verified, 800u);
  EXPECT_EQ(report.ticks_verified, report.last_tick) << "all that is there";
  EXPECT_EQ(report.reasons.size(), 1u);
  EXPECT_EQ(exit_code(path), 6);
}

TEST_F(Verify, AnotherSimVersionIsNamed) {
  const auto report = verify_copy([](auto, auto&) { return true; }, kSimVersion + 1);
  expect_reason(report, "sim_version " + std::to_string(kSimVersion + 1));
  EXPECT_FALSE(report.is_resimulated);
  EXPECT_EQ(report.ticks_verified, 0u);
  EXPECT_GT(report.surfaces_decoded, 100u);
  EXPECT_EQ(exit_code(at("copy.mcap")), 6);
}

TEST_F(Verify, WithoutTickRecordsNothingIsVerified) {
  const auto report =
      verify_copy([](std::string_view topic, auto&) { return topic != "/tick_batch"; });
  expect_reason(report, "no tick records");
  EXPECT_EQ(report.ticks_missing, kRecordedTicks);
  EXPECT_EQ(exit_code(at("copy.mcap")), 6);
}

// Written by trocar-server with sim_version 11: one hand presses, one cuts.
TEST_F(Verify, ARecordingOfBeforeStillOpens) {
  const std::string path = std::string(TROCAR_SOURCE_DIR) + "/tests/recording/session_sim11.mcap";
  auto journal = journal::SessionJournal::open(path);
  ASSERT_TRUE(journal.ok()) << journal.error().message;
  EXPECT_EQ((*journal)->info().sim_version, 11u);
  EXPECT_EQ((*journal)->info().last_tick, 1200u);
  EXPECT_EQ((*journal)->info().participants.size(), 2u);
  const auto report = verify(path);
  expect_reason(report, "sim_version 11");
  EXPECT_EQ(report.surfaces_decoded, 76u) << "74 deltas and 2 keyframes";
  EXPECT_EQ(report.ticks_missing, 0u);
}

}  // namespace
}  // namespace trocar::recording::testing
