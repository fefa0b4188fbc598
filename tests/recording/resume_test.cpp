// A session goes on where its recording ends, in the state that verification finds there; what
// cannot be gone on with is refused with a reason.

#include "server/session/recording/resume.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "proto/journal.pb.h"
#include "server/session/recording/recorded_session.h"
#include "server/session/recording/recorder.h"
#include "server/session/recording/verify.h"
#include "tests/recording/recorded_simulation.h"
#include "tests/support/files.h"

namespace trocar::recording::testing {
namespace {

using trocar::testing::load_file;
using trocar::testing::save_file;
using trocar::testing::TemporaryFolder;

class Resume : public ::testing::Test {
 protected:
  // The first part of the file, as a killed server leaves it.
  std::string cut_off(double share) {
    const auto bytes = load_file(recorded_simulation());
    const auto path = folder_.file("cut.mcap");
    save_file(path, BytesView(bytes).first(
                        static_cast<std::size_t>(share * static_cast<double>(bytes.size()))));
    return path;
  }
  void expect_refusal(const std::string& path, const std::string& says) {
    const auto session = resume_session(path, {});
    ASSERT_FALSE(session.ok());
    EXPECT_NE(session.error().message.find(says), std::string::npos) << session.error().message;
    EXPECT_EQ(session.error().message.find('\n'), std::string::npos);
  }
  std::string copy(const Edit& edit, std::uint32_t sim_version = kSimVersion) {
    const auto path = folder_.file("copy.mcap");
    copy_journal(recorded_simulation(), path, edit, sim_version);
    return path;
  }

  TemporaryFolder folder_;
};

TEST_F(Resume, GoesOnInTheStateThatVerificationFinds) {
  const auto path = cut_off(0.8);
  const auto report = verify_journal(path);
  ASSERT_TRUE(report.ok());
  auto session = resume_session(path, {});
  ASSERT_TRUE(session.ok()) << session.error().message;
  EXPECT_EQ(session->state_hash, report->last_hash);
  EXPECT_EQ(session->continuation.tick, report->last_tick);
  EXPECT_EQ(session->continuation.tick % kTicksPerFrame, 0u);
  EXPECT_EQ(session->continuation.file, "cut.mcap");
  EXPECT_EQ(session->simulation.current_tick(), report->last_tick);
  EXPECT_GT(session->continuation.tick, session->snapshot_tick);
  EXPECT_GT(session->snapshot_tick, 0u);
  EXPECT_GT(session->simulation.layout().epoch, 0u) << "the cuts are there";
  ASSERT_EQ(session->participants.size(), 3u);
  EXPECT_EQ(session->participants[1].name, "Hand 1");
  EXPECT_EQ(session->participants[1].tools.size(), 1u);
  EXPECT_TRUE(session->unnamed_hands.empty());
}

TEST_F(Resume, GivesTheHashesThatTheSessionWouldHaveHad) {
  auto session = resume_session(cut_off(0.6), {});
  ASSERT_TRUE(session.ok()) << session.error().message;
  auto journal = journal::SessionJournal::open(recorded_simulation());
  ASSERT_TRUE(journal.ok());
  auto& simulation = session->simulation;
  Tick compared = 0;
  const auto read = read_ticks(**journal, [&](const step::TickRecord& record, bool&) {
    if (record.tick <= simulation.current_tick()) return Status();
    EXPECT_EQ(simulation.tick(record.inputs, record.decisions).state_hash, record.state_hash);
    ++compared;
    return Status();
  });
  EXPECT_TRUE(read.ok());
  EXPECT_GT(compared, 500u);
}

TEST_F(Resume, TheNextJournalSaysWhatItContinuesAndIsVerified) {
  auto session = resume_session(cut_off(0.6), {});
  ASSERT_TRUE(session.ok()) << session.error().message;
  auto& simulation = session->simulation;
  const auto next = folder_.file("next.mcap");
  Beginning beginning;
  beginning.continues = session->continuation;
  auto recorder = Recorder::create(next, simulation.organ(), simulation.layout(), beginning);
  ASSERT_TRUE(recorder.ok()) << recorder.error().message;
  (*recorder)->record_participants(session->participants, 0);
  Bytes state;
  simulation.write_snapshot(state);
  auto snapshot = std::make_shared<const Bytes>(std::move(state));
  std::vector<step::TickRecord> records;
  hands::TickInputs inputs;
  for (int i = 0; i < 1280; ++i) {
    const auto& done = simulation.tick(inputs, {});
    records.push_back({done.tick, {}, inputs, done.state_hash});
    auto frame = simulation.pop_frame();
    if (!frame) continue;
    frame->records = std::exchange(records, {});
    frame->snapshot = std::exchange(snapshot, nullptr);
    frame->snapshot_tick = session->continuation.tick;
    (*recorder)->record_frame(frame);
  }
  ASSERT_TRUE((*recorder)->close().ok());
  auto journal = journal::SessionJournal::open(next);
  ASSERT_TRUE(journal.ok());
  EXPECT_EQ((*journal)->info().continues, session->continuation);
  const auto report = verify_journal(next);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->verdict(), Verdict::Verified) << report->why();
  EXPECT_EQ(report->begin_tick, session->continuation.tick);
  EXPECT_EQ(report->ticks_verified, 1280u);
  EXPECT_EQ(report->frames_verified, 80u);
  const auto again = resume_session(next, {});
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_EQ(again->state_hash, report->last_hash);
}

TEST_F(Resume, RefusesWhatItCannotGoOnWith) {
  const auto all = [](auto, auto&) { return true; };
  expect_refusal(folder_.file("nothing.mcap"), "nothing.mcap");
  expect_refusal(std::string(TROCAR_SOURCE_DIR) + "/tests/recording/session_sim11.mcap",
                 "sim_version 11");
  expect_refusal(copy(all, kSimVersion + 1), "sim_version");
  std::filesystem::remove(folder_.file("copy.mcap"));
  int batches = 0;
  expect_refusal(copy([&](std::string_view topic, auto&) {
                   return topic != "/tick_batch" || ++batches != 40;
                 }),
                 "it has a gap, tick 625 is missing");
  std::filesystem::remove(folder_.file("copy.mcap"));
  expect_refusal(copy([&](std::string_view topic, auto&) { return topic != "/tick_batch"; }),
                 "it holds no tick");
  std::filesystem::remove(folder_.file("copy.mcap"));
  expect_refusal(copy([&](std::string_view topic, auto&) { return topic != "/world/snapshot"; }),
                 "it has no snapshot");
  const auto gapped = folder_.file("gapped.mcap");
  record_simulation(gapped, 1200);
  expect_refusal(gapped, "it has a gap, 1 frames were never recorded");
}

TEST_F(Resume, RefusesARecordingThatDoesNotSimulateToItsHashes) {
  expect_refusal(copy([](std::string_view topic, google::protobuf::Message& message) {
                   if (topic != "/tick_batch") return true;
                   for (auto& record : *static_cast<proto::TickBatch&>(message).mutable_record())
                     if (record.tick() == 2000) record.set_state_hash(1);
                   return true;
                 }),
                 "tick 2000 has another state than was recorded");
}

}  // namespace
}  // namespace trocar::recording::testing
