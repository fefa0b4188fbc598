// The recordings of a session whose servers were killed become one, which says what a session
// without a crash says.

#include "server/session/recording/merge.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <memory>

#include "common/base/bytes.h"
#include "common/base/checksum.h"
#include "common/base/version.h"
#include "common/journal/recording_end.h"
#include "common/journal/session_journal.h"
#include "common/journal/session_journal_writer.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/recording/session_copy.h"
#include "server/session/recording/session_parts.h"
#include "server/session/recording/verify.h"
#include "tests/recording/continued_session.h"
#include "tests/recording/forged_recording.h"
#include "tests/recording/read_recording.h"
#include "tests/recording/recorded_simulation.h"
#include "tests/support/files.h"

namespace trocar::recording::testing {
namespace {

namespace fs = std::filesystem;
using trocar::testing::TemporaryFolder;

const auto kAll = [](auto, auto&) { return true; };

// A session in three parts, simulated once for all tests that do not change it.
struct Parts {
  explicit Parts(bool bleeds) {
    step::SceneRules rules;
    if (bleeds) rules.bleeding.emplace();
    record_simulation(whole, 0, rules);
    cut_off(whole, 0.45, first);
    go_on(first, whole, folder.file("full.mcap"), kRecordedTicks);
    cut_off(folder.file("full.mcap"), 0.6, second);
    go_on(second, whole, third, kRecordedTicks);
  }
  std::vector<std::string> all() const { return {first, second, third}; }

  TemporaryFolder folder;
  std::string whole = folder.file("whole.mcap"), first = folder.file("session.mcap"),
              second = folder.file("session-2.mcap"), third = folder.file("session-3.mcap");
};

const Parts& dry() {
  static const Parts parts(false);
  return parts;
}

class Merge : public ::testing::Test {
 protected:
  void expect_refusal(const std::vector<std::string>& parts, const std::string& says) {
    const auto merged = merge(parts, to_);
    ASSERT_FALSE(merged.ok());
    EXPECT_NE(merged.error().message.find(says), std::string::npos) << merged.error().message;
    EXPECT_EQ(merged.error().message.find('\n'), std::string::npos);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder_.file("")), {}), files_)
        << "nothing is left behind";
  }

  TemporaryFolder folder_;
  std::string to_ = folder_.file("merged.mcap");
  std::ptrdiff_t files_ = 0;  // that a test has put there
};

TEST_F(Merge, ThreePartsAreOneRecordingThatVerifies) {
  const auto& parts = dry();
  const auto merged = merge({parts.second, parts.third, parts.first}, to_);
  ASSERT_TRUE(merged.ok()) << merged.error().message;
  ASSERT_EQ(merged->joins.size(), 2u);
  EXPECT_EQ(merged->parts, parts.all());
  EXPECT_EQ(merged->torn_frames, 0u);
  EXPECT_TRUE(merged->has_end);
  EXPECT_EQ(merged->last_tick, kRecordedTicks);
  const auto report = verify_journal(to_), whole = verify_journal(parts.whole);
  ASSERT_TRUE(report.ok() && whole.ok());
  EXPECT_EQ(report->verdict(), Verdict::Verified) << report->why();
  EXPECT_EQ(report->ticks_verified, kRecordedTicks);
  EXPECT_EQ(report->frames_verified, whole->frames_verified);
  EXPECT_EQ(report->last_hash, whole->last_hash);
  EXPECT_EQ(report->joins, merged->joins);
  auto journal = journal::SessionJournal::open(to_);
  ASSERT_TRUE(journal.ok());
  const auto& info = (*journal)->info();
  EXPECT_EQ(info.joins, merged->joins);
  EXPECT_EQ(info.gap_messages, 0u);
  EXPECT_EQ(info.begin_tick(), 0u);
  EXPECT_TRUE(info.is_finished);
  auto first = journal::SessionJournal::open(parts.first);
  ASSERT_TRUE(first.ok());
  EXPECT_EQ(info.start_utc_ns, (*first)->info().start_utc_ns);
  const auto again = open_session_parts(to_);
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(again->parts.size(), 1u);
  EXPECT_EQ(again->missing, "");
}

TEST_F(Merge, ItShowsWhatASessionWithoutACrashShows) {
  ASSERT_TRUE(merge(dry().all(), to_).ok());
  EXPECT_EQ(surfaces_of(to_), surfaces_of(dry().whole));
  const auto merged = overviews_of(to_), whole = overviews_of(dry().whole);
  ASSERT_EQ(merged.size(), whole.size());
  for (std::size_t i = 0; i < merged.size(); ++i) {
    EXPECT_EQ(merged[i].bins(), whole[i].bins());
    ASSERT_EQ(merged[i].tool_size(), whole[i].tool_size());
    for (int tool = 0; tool < merged[i].tool_size(); ++tool)
      EXPECT_EQ(merged[i].tool(tool).SerializeAsString(), whole[i].tool(tool).SerializeAsString());
    EXPECT_EQ(merged[i].claim_size(), whole[i].claim_size());
  }
}

TEST_F(Merge, ASessionThatBleedsVerifiesToo) {
  const Parts parts(true);
  const auto merged = merge(parts.all(), to_);
  ASSERT_TRUE(merged.ok()) << merged.error().message;
  const auto report = verify_journal(to_);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->verdict(), Verdict::Verified) << report->why();
  EXPECT_GT(report->bled_surfaces, 0u);
}

TEST_F(Merge, WhoDoesNotComeBackIsThereNoMore) {
  const auto& parts = dry();
  const auto first = folder_.file("session.mcap"), second = folder_.file("session-2.mcap");
  cut_off(parts.whole, 0.3, first);  // so that more than the second follows in which a list is new
  go_on_alone(first, parts.whole, second, kRecordedTicks);
  const auto merged = merge({first, second}, to_);
  ASSERT_TRUE(merged.ok()) << merged.error().message;
  ASSERT_LT(merged->joins.front() + 1100, kRecordedTicks);
  const auto report = verify_journal(to_);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->verdict(), Verdict::Verified) << report->why();
}

TEST_F(Merge, AnEndThatWasCutShortStaysMissing) {
  const auto& parts = dry();
  for (const auto* part : {&parts.first, &parts.second})
    fs::copy(*part, folder_.file(fs::path(*part).filename().string()));
  const auto merged = merge({folder_.file("session.mcap"), folder_.file("session-2.mcap")}, to_);
  ASSERT_TRUE(merged.ok()) << merged.error().message;
  EXPECT_FALSE(merged->has_end);
  const auto report = verify_journal(to_);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->verdict(), Verdict::NotVerified);
  ASSERT_EQ(report->reasons.size(), 1u) << report->why();
  EXPECT_NE(report->reasons.front().find("it has no end"), std::string::npos) << report->why();
}

TEST_F(Merge, WhatAKilledServerHasNotWrittenOfAFrameIsNamed) {
  const auto& parts = dry();
  auto second = journal::SessionJournal::open(parts.second);
  ASSERT_TRUE(second.ok());
  const Tick join = (*second)->info().begin_tick();
  copy_journal(parts.first, folder_.file("session.mcap"),
               [&](std::string_view topic, const google::protobuf::Message& message) {
                 return topic != "/frame_state" ||
                        static_cast<const proto::FrameState&>(message).tick() != join;
               });
  for (const auto* part : {&parts.second, &parts.third})
    fs::copy(*part, folder_.file(fs::path(*part).filename().string()));
  const auto merged = merge({folder_.file("session.mcap"), folder_.file("session-2.mcap"),
                             folder_.file("session-3.mcap")},
                            to_);
  ASSERT_TRUE(merged.ok()) << merged.error().message;
  EXPECT_EQ(merged->torn_frames, 1u);
  const auto report = verify_journal(to_);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->verdict(), Verdict::NotVerified);
  EXPECT_NE(report->why().find("a message on /frame_state is missing"), std::string::npos)
      << report->why();
}

TEST_F(Merge, AStateThatDoesNotFollowIsFound) {
  ASSERT_TRUE(merge(dry().all(), to_).ok());
  const auto changed = folder_.file("changed.mcap");
  int snapshots = 0;
  copy_journal(to_, changed, [&](std::string_view topic, google::protobuf::Message& message) {
    if (topic != "/world/snapshot" || ++snapshots != 3) return true;  // that of the second part
    auto& snapshot = static_cast<proto::WorldSnapshot&>(message);
    auto state = snapshot.state();
    state.back() = static_cast<char>(state.back() ^ 1);
    snapshot.set_state(state);
    snapshot.set_state_hash(xxh3_64(bytes_of(std::string_view(state))));
    return true;
  });
  const auto report = verify_journal(changed);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->verdict(), Verdict::Different) << report->why();
}

TEST_F(Merge, RefusesPartsThatDoNotContinueEachOther) {
  const auto& parts = dry();
  expect_refusal({parts.first, folder_.file("none.mcap")}, "none.mcap");
  expect_refusal({parts.first, parts.third}, "session-2.mcap: is a part of this session, too");
  expect_refusal({parts.second, parts.third}, "session.mcap: is a part of this session, too");
  expect_refusal({parts.first, parts.whole}, "is no part of this session");
  expect_refusal({parts.first, parts.first}, "there is nothing to merge");
  files_ = 1;
  fs::copy(parts.second, folder_.file("session-2.mcap"));
  expect_refusal({parts.first, folder_.file("session-2.mcap")}, "is no part of this session");
  files_ = 2;
  copy_journal(parts.first, folder_.file("session.mcap"), kAll, kSimVersion + 1);
  expect_refusal({folder_.file("session.mcap"), folder_.file("session-2.mcap")},
                 "was recorded by another release");
}

// A merged recording gets a right end, which a part that was changed must not come by.
TEST_F(Merge, RefusesAPartThatIsNotWhatItsEndSays) {
  const auto& parts = dry();
  const std::vector<std::string> here{folder_.file("session.mcap"), folder_.file("session-2.mcap"),
                                      folder_.file("session-3.mcap")};
  fs::copy(parts.first, here[0]);
  fs::copy(parts.second, here[1]);
  files_ = 3;
  const auto is_frame = [](const journal::McapChannel& channel) {
    return channel.topic == journal::topic_name(journal::JournalTopic::FrameState);
  };
  const auto refused = [&](const char* says, const KeepsMessage& keeps,
                           const KeepsMetadata& keeps_metadata = kAllMetadata) {
    forge(parts.third, here[2], keeps, keeps_metadata);
    expect_refusal(here, says);
    fs::remove(here[2]);
  };
  std::uint64_t last = 0;
  forge(parts.third, here[2], [&](auto&, const journal::McapMessage& message) {
    last = std::max(last, message.log_time);
    return true;
  });
  ASSERT_TRUE(merge(here, to_).ok()) << "a copy is no change";
  fs::remove(to_);
  fs::remove(here[2]);
  constexpr std::uint64_t kSecond_ns = 1'000'000'000;
  refused("messages, the end of the recording counts",
          [&](auto&, const auto& message) { return message.log_time + kSecond_ns / 2 < last; });
  refused("messages, the end of the recording counts",
          [&](const auto& channel, auto&) { return !is_frame(channel); });
  std::vector<std::uint8_t> altered;
  refused("messages_sha256: is ", [&](const auto& channel, journal::McapMessage& message) {
    if (!altered.empty() || !is_frame(channel)) return true;
    altered.assign(message.data.begin(), message.data.end());
    altered.back() ^= 1;
    message.data = altered;
    return true;
  });
  refused("metadata_sha256: is ", kAllMessages, [](journal::McapMetadata& metadata) {
    if (metadata.name == journal::kSessionMetadataName) metadata.entries["organ_name"] = "kidney";
    return true;
  });
  refused("the end that counts its messages was taken out", kAllMessages,
          [](const journal::McapMetadata& metadata) {
            return metadata.name != journal::kEndMetadataName;
          });
  // A part of a killed server has no end, but is not closed, either.
  fs::copy(parts.third, here[2]);
  fs::remove(here[0]);
  forge(parts.first, here[0], [&](const auto& channel, auto&) { return !is_frame(channel); });
  expect_refusal(here, "the end that counts its messages was taken out");
}

// A part that was not written by a server: its messages come before the place where it goes on.
TEST_F(Merge, RefusesTicksThatGoBack) {
  const auto first = folder_.file("session.mcap"), second = folder_.file("session-2.mcap");
  fs::copy(dry().first, first);
  auto journal = journal::SessionJournal::open(first);
  ASSERT_TRUE(journal.ok());
  const auto& info = (*journal)->info();
  const Tick join = info.last_tick;
  files_ = 2;
  for (const bool is_tool : {false, true}) {
    fs::remove(second);
    auto writer = journal::SessionJournalWriter::create(
        second, {.start_utc_ns = info.start_utc_ns,
                 .sim_version = info.sim_version,
                 .organ_name = info.organ_name,
                 .organ_hash = info.organ_hash,
                 .has_external_loads = false,
                 .starts_from_snapshot = false,
                 .has_implicit_strain = false,
                 .continues = journal::Continuation{"session.mcap", join},
                 .trimmed = {}});
    ASSERT_TRUE(writer.ok()) << writer.error().message;
    const auto written =
        is_tool ? (*writer)->write_tool({0}, join - 50, 1, proto::ToolState())
                : (*writer)->write(journal::JournalTopic::Claims, join - 50, 1, proto::ClaimLog());
    ASSERT_TRUE(written.ok() && (*writer)->close().ok());
    expect_refusal({first, second}, is_tool ? "/tool/0: a message at tick" : "a message at tick");
  }
}

TEST_F(Merge, JoinsThatNoMergeWritesAreToldAndBounded) {
  auto journal = journal::SessionJournal::open(dry().whole);
  auto reader = journal::McapReader::open(dry().whole);
  ASSERT_TRUE(journal.ok() && reader.ok());
  const auto& info = (*journal)->info();
  auto copy = SessionCopy::create(to_, info);
  ASSERT_TRUE(copy.ok());
  const journal::JournalTimes times{info.start_utc_ns};
  Status written;
  (*reader)->read({}, {}, [&](const journal::McapMessage& message) {
    written = (*copy)->write((*reader)->channels().at(message.channel_id).topic,
                             times.tick(message.log_time), message.publish_time, message.data);
    return written.ok();
  });
  ASSERT_TRUE(written.ok()) << written.error().message;
  proto::JournalGap mark;
  mark.set_first_tick(info.last_tick + 1);
  mark.set_last_tick(info.last_tick);
  mark.set_is_join(true);
  for (std::size_t i = 0; i < 2 * journal::kMostParts; ++i)
    ASSERT_TRUE((*copy)->write(journal::JournalTopic::Gap, info.last_tick, 1, mark).ok());
  ASSERT_TRUE((*copy)->finish({"test", {}}).ok());
  const auto report = verify_journal(to_);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->verdict(), Verdict::NotVerified) << report->why();
  EXPECT_NE(report->why().find("is there twice"), std::string::npos) << report->why();
  EXPECT_EQ(report->joins.size(), 1u);
  auto again = journal::SessionJournal::open(to_);
  ASSERT_TRUE(again.ok());
  EXPECT_EQ((*again)->info().joins.size(), journal::kMostParts);
}

TEST_F(Merge, OverwritesNothing) {
  files_ = 1;
  trocar::testing::save_file(to_, {});
  expect_refusal(dry().all(), "exists already");
}

TEST_F(Merge, AFileThatIsMadeMeanwhileStays) {
  auto journal = journal::SessionJournal::open(dry().whole);
  ASSERT_TRUE(journal.ok());
  auto organ = (*journal)->organ();
  auto copy = SessionCopy::create(to_, (*journal)->info());
  ASSERT_TRUE(organ.ok() && copy.ok());
  ASSERT_TRUE((*copy)->write(journal::JournalTopic::Organ, 0, 1, *organ).ok());
  trocar::testing::save_file(to_, bytes_of(std::string_view("another")));
  const auto finished = (*copy)->finish({"test", {}});
  ASSERT_FALSE(finished.ok());
  EXPECT_EQ(finished.error().code, ErrorCode::BadFile);
  EXPECT_NE(finished.error().message.find("exists already"), std::string::npos);
  EXPECT_EQ(fs::file_size(to_), 7u);
}

// A limit of this process stands for a disk without room.
TEST_F(Merge, ADiskWithoutRoomIsToldOfTheOutput) {
  const auto parts = dry().all();
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{.rlim_cur = 100'000, .rlim_max = before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const auto merged = merge(parts, to_);
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  ASSERT_FALSE(merged.ok());
  EXPECT_EQ(merged.error().code, ErrorCode::ResourceMissing);
  EXPECT_TRUE(merged.error().message.starts_with(to_)) << merged.error().message;
  EXPECT_TRUE(fs::is_empty(folder_.file("")));
}

}  // namespace
}  // namespace trocar::recording::testing
