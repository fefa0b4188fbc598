// A shorter recording begins with a keyframe, shows what the whole one shows there, and verifies.

#include "server/session/recording/trim.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "common/journal/session_journal.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/recording/recorded_session.h"
#include "server/session/recording/resume.h"
#include "server/session/recording/session_parts.h"
#include "server/session/recording/verify.h"
#include "tests/recording/read_recording.h"
#include "tests/recording/recorded_simulation.h"
#include "tests/support/files.h"

namespace trocar::recording::testing {
namespace {

namespace fs = std::filesystem;
using trocar::testing::TemporaryFolder;

constexpr Tick kFrom = 1500, kTo = 2005;

const auto kAsItIs = [](auto, auto&) { return true; };

class Trim : public ::testing::Test {
 protected:
  void expect_refusal(const std::string& path, const TrimOptions& options,
                      const std::string& says) {
    const auto files = std::distance(fs::directory_iterator(folder_.file("")), {});
    const auto trimmed = trim(path, to_, options);
    ASSERT_FALSE(trimmed.ok());
    EXPECT_NE(trimmed.error().message.find(says), std::string::npos) << trimmed.error().message;
    EXPECT_EQ(trimmed.error().message.find('\n'), std::string::npos);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder_.file("")), {}), files)
        << "nothing is left behind";
  }
  // Returns the hash after a tick of the whole recording.
  static std::uint64_t hash_after(Tick tick) {
    auto journal = journal::SessionJournal::open(recorded_simulation());
    std::uint64_t hash = 0;
    EXPECT_TRUE(read_ticks(**journal, [&](const step::TickRecord& record, bool& stop) {
                  hash = record.state_hash;
                  stop = record.tick >= tick;
                  return Status();
                }).ok());
    return hash;
  }

  TemporaryFolder folder_;
  std::string to_ = folder_.file("trimmed.mcap");
};

TEST_F(Trim, APartFromTheMiddleVerifiesByItself) {
  const auto trimmed = trim(recorded_simulation(), to_, {.from = kFrom, .to = kTo});
  ASSERT_TRUE(trimmed.ok()) << trimmed.error().message;
  EXPECT_TRUE(trimmed->has_state);
  EXPECT_LE(trimmed->from, kFrom);
  EXPECT_GT(trimmed->from + kTicksPerSecond, kFrom - kTicksPerFrame) << "keyframes are 1 Hz";
  EXPECT_LE(trimmed->to, kTo);
  EXPECT_GT(trimmed->to + kTicksPerFrame, kTo);
  const auto report = verify_journal(to_);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->verdict(), Verdict::Verified) << report->why();
  EXPECT_EQ(report->begin_tick, trimmed->from);
  EXPECT_EQ(report->ticks_verified, trimmed->to - trimmed->from);
  EXPECT_EQ(report->frames_verified, (trimmed->to - trimmed->from) / kTicksPerFrame);
  EXPECT_EQ(report->last_hash, hash_after(trimmed->to));
  EXPECT_GT(report->participants_verified + 63, report->frames_verified)
      << "after the second in which a list is new";
}

TEST_F(Trim, ItShowsWhatTheWholeRecordingShowsThere) {
  const auto trimmed = trim(recorded_simulation(), to_, {.from = kFrom, .to = kTo});
  ASSERT_TRUE(trimmed.ok()) << trimmed.error().message;
  auto expected = surfaces_of(recorded_simulation());
  std::erase_if(expected, [&](const auto& entry) {
    return entry.first <= trimmed->from || entry.first > trimmed->to;
  });
  EXPECT_EQ(surfaces_of(to_), expected);
  auto journal = journal::SessionJournal::open(to_),
       before = journal::SessionJournal::open(recorded_simulation());
  ASSERT_TRUE(journal.ok() && before.ok());
  const auto& info = (*journal)->info();
  EXPECT_EQ(info.start_utc_ns, (*before)->info().start_utc_ns);
  EXPECT_EQ(info.participants.size(), 3u);
  ASSERT_TRUE(info.trimmed.has_value());
  EXPECT_EQ(info.trimmed->file, "recorded.mcap");
  EXPECT_FALSE(info.continues.has_value());
  const auto parts = open_session_parts(to_);
  ASSERT_TRUE(parts.ok());
  EXPECT_EQ(parts->parts.size(), 1u);
  EXPECT_NE(parts->missing.find("cut out of recorded.mcap"), std::string::npos);
}

TEST_F(Trim, FromItsBeginningItIsTheSameRecording) {
  const auto trimmed = trim(recorded_simulation(), to_, {.from = 0, .to = 100'000});
  ASSERT_TRUE(trimmed.ok()) << trimmed.error().message;
  EXPECT_EQ(trimmed->to, kRecordedTicks);
  const auto report = verify_journal(to_);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->verdict(), Verdict::Verified) << report->why();
  EXPECT_EQ(report->ticks_verified, kRecordedTicks);
  // Overviews are made anew from messages, and are those that were made from frames.
  const auto anew = overviews_of(to_), recorded = overviews_of(recorded_simulation());
  ASSERT_EQ(anew.size(), recorded.size());
  for (std::size_t i = 0; i < anew.size(); ++i)
    EXPECT_EQ(anew[i].SerializeAsString(), recorded[i].SerializeAsString())
        << anew[i].ShortDebugString() << "\n"
        << recorded[i].ShortDebugString();
}

TEST_F(Trim, ASessionThatBleedsVerifiesToo) {
  const auto bleeding = folder_.file("bleeding.mcap");
  record_simulation(bleeding, 0, {.bleeding = bleeding::Rules{}});
  const auto trimmed = trim(bleeding, to_, {.from = kFrom, .to = kTo});
  ASSERT_TRUE(trimmed.ok()) << trimmed.error().message;
  const auto report = verify_journal(to_);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->verdict(), Verdict::Verified) << report->why();
  EXPECT_GT(report->bled_surfaces, 0u);
}

TEST_F(Trim, ATrimmedRecordingCanBeTrimmedAndGoneOnWith) {
  ASSERT_TRUE(trim(recorded_simulation(), to_, {.from = kFrom, .to = kTo}).ok());
  const auto shorter = folder_.file("shorter.mcap");
  const auto trimmed = trim(to_, shorter, {.from = kFrom, .to = kFrom + 200});
  ASSERT_TRUE(trimmed.ok()) << trimmed.error().message;
  const auto report = verify_journal(shorter);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->verdict(), Verdict::Verified) << report->why();
  const auto session = resume_session(to_, {});
  ASSERT_TRUE(session.ok()) << session.error().message;
  EXPECT_EQ(session->state_hash, hash_after(session->continuation.tick));
}

TEST_F(Trim, ARecordingOfAnotherReleaseCanBeWatched) {
  const auto other = folder_.file("other.mcap");
  copy_journal(recorded_simulation(), other, kAsItIs, kSimVersion + 1);
  const auto trimmed = trim(other, to_, {.from = kFrom, .to = kTo});
  ASSERT_TRUE(trimmed.ok()) << trimmed.error().message;
  EXPECT_FALSE(trimmed->has_state);
  EXPECT_EQ(surfaces_of(to_).size(), (trimmed->to - trimmed->from) / kTicksPerFrame);
  const auto report = verify_journal(to_);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->verdict(), Verdict::NotVerified);
  EXPECT_FALSE(report->is_resimulated);
}

TEST_F(Trim, RefusesWhatItCannotCut) {
  expect_refusal(folder_.file("none.mcap"), {.from = 0, .to = 1}, "none.mcap");
  expect_refusal(recorded_simulation(), {.from = 100, .to = 100}, "--from has to lie before --to");
  expect_refusal(recorded_simulation(), {.from = kRecordedTicks, .to = 9000},
                 "before its end, 2.400 s");
  expect_refusal(recorded_simulation(), {.from = 1, .to = 2}, "has no frame between");
  const auto gapped = folder_.file("gapped.mcap");
  record_simulation(gapped, 800);
  expect_refusal(gapped, {.from = kFrom, .to = kTo}, "it has a gap");
  trocar::testing::save_file(to_, {});
  expect_refusal(recorded_simulation(), {.from = kFrom, .to = kTo}, "exists already");
}

}  // namespace
}  // namespace trocar::recording::testing
