// A recording that was shortened or thinned and closed anew is found by what its end says, and a
// signature says whose it is. The forged files here are made with the project's own writer.

#include <gtest/gtest.h>
#include <openssl/evp.h>
#include <openssl/pem.h>

#include <filesystem>
#include <memory>

#include "common/base/exit_code.h"
#include "common/journal/mcap_copy.h"
#include "common/journal/recording_end.h"
#include "common/journal/session_journal.h"
#include "common/secure/signing.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/session/recording/recorder.h"
#include "server/session/recording/verify.h"
#include "server/tissue/step/simulation.h"
#include "tests/recording/forged_recording.h"
#include "tests/recording/recorded_simulation.h"
#include "tests/support/files.h"
#include "tests/support/program_fixture.h"

namespace trocar::recording::testing {
namespace {

using journal::EndStatus;
using journal::McapChannel;
using journal::McapMessage;
using journal::McapMetadata;
using trocar::testing::load_file;
using trocar::testing::load_text;
using trocar::testing::save_file;
using trocar::testing::TemporaryFolder;

constexpr auto kNotVerified = static_cast<int>(ExitCode::NotVerified);
constexpr auto kMismatch = static_cast<int>(ExitCode::Mismatch);
constexpr auto kBadFile = static_cast<int>(ExitCode::BadFile);

// Writes a key pair as openssl's own program does.
void make_keys(const std::string& private_file, const std::string& public_file,
               const char* kind = "ED25519") {
  const std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)> key(
      EVP_PKEY_Q_keygen(nullptr, nullptr, kind), EVP_PKEY_free);
  ASSERT_NE(key, nullptr);
  const auto write = [](const std::string& file, auto put) {
    std::FILE* out = std::fopen(file.c_str(), "w");
    ASSERT_NE(out, nullptr);
    EXPECT_EQ(put(out), 1);
    std::fclose(out);
  };
  write(private_file, [&](std::FILE* out) {
    return PEM_write_PrivateKey(out, key.get(), nullptr, nullptr, 0, nullptr, nullptr);
  });
  write(public_file, [&](std::FILE* out) { return PEM_write_PUBKEY(out, key.get()); });
}

class RecordingEnd : public trocar::testing::ProgramFixture {
 protected:
  RecordingEnd() : ProgramFixture("trocar-journal") {}

  static std::uint64_t time_of(Tick tick) {
    auto journal = journal::SessionJournal::open(recorded_simulation());
    return journal::JournalTimes{(*journal)->info().start_utc_ns}.log_time(tick);
  }
  static EndStatus status_of(const std::string& path) {
    auto reader = journal::McapReader::open(path);
    EXPECT_TRUE(reader.ok());
    return journal::check_end(**reader).status;
  }
  void expect_changed(const std::string& path, const std::string& says) {
    EXPECT_EQ(run({"verify", path}), kNotVerified) << log();
    EXPECT_NE(log().find("not verified: " + says), std::string::npos) << log();
    EXPECT_EQ(status_of(path), EndStatus::Wrong);
  }
};

TEST_F(RecordingEnd, OfASoundRecordingCountsWhatIsThere) {
  auto reader = journal::McapReader::open(recorded_simulation());
  ASSERT_TRUE(reader.ok());
  const auto& end = (*reader)->metadata().back();
  EXPECT_EQ(end.name, journal::kEndMetadataName);
  EXPECT_EQ(end.entries.at("/world/snapshot"), std::to_string(1 + std::size(kSnapshotTicks)));
  EXPECT_EQ(end.entries.at("messages"), std::to_string((*reader)->statistics().message_count));
  EXPECT_EQ(status_of(recorded_simulation()), EndStatus::Right);
}

TEST_F(RecordingEnd, OfAShortenedRecordingIsWrong) {
  const auto path = at("short.mcap");
  const auto last = time_of(1600);
  forge(recorded_simulation(), path,
        [&](auto&, const McapMessage& message) { return message.log_time <= last; });
  expect_changed(path, "/claims: ");
  auto journal = journal::SessionJournal::open(path);
  ASSERT_TRUE(journal.ok());
  EXPECT_FALSE((*journal)->info().is_finished);
  EXPECT_NE((*journal)->info().summary.find("it was changed since"), std::string::npos);
}

TEST_F(RecordingEnd, IsMissedWhereItWasTakenOutToo) {
  const auto path = at("endless.mcap");
  const auto last = time_of(1600);
  forge(
      recorded_simulation(), path,
      [&](auto&, const McapMessage& message) { return message.log_time <= last; },
      [](McapMetadata& metadata) { return metadata.name != journal::kEndMetadataName; });
  expect_changed(path, "the end that counts its messages was taken out");
}

TEST_F(RecordingEnd, OfARecordingWithoutItsSnapshotsIsWrong) {
  const auto path = at("no_snapshots.mcap");
  forge(recorded_simulation(), path,
        [](const McapChannel& channel, auto&) { return channel.topic != "/world/snapshot"; });
  expect_changed(path, "/world/snapshot: 0 messages, the end of the recording counts 3");
}

TEST_F(RecordingEnd, MissesOtherTimesAndOtherMetadataAsWell) {
  const auto path = at("note.mcap");
  forge(recorded_simulation(), path, kAllMessages, [](McapMetadata& metadata) {
    if (metadata.name == journal::kSessionMetadataName) metadata.entries["organ_name"] = "kidney";
    return true;
  });
  expect_changed(path, "metadata_sha256: is ");
}

TEST_F(RecordingEnd, OfAnOlderVersionIsReadAndSaidToBeUnknown) {
  const auto path = at("older.mcap");
  forge(recorded_simulation(), path, kAllMessages, [](McapMetadata& metadata) {
    metadata.entries.erase(journal::kPromisedEnd);
    return metadata.name != journal::kEndMetadataName;
  });
  EXPECT_EQ(run({"verify", path}), kNotVerified);
  EXPECT_NE(log().find("not verified: an older version recorded it"), std::string::npos) << log();
  const auto report = verify_journal(path);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->reasons.size(), 1u);
  EXPECT_EQ(report->ticks_verified, kRecordedTicks) << "all the rest is compared";
  // A copy by this version counts what is there.
  ASSERT_EQ(run({"anonymise", path, at("copy.mcap")}), 0) << log();
  EXPECT_EQ(status_of(at("copy.mcap")), EndStatus::Right);
}

TEST_F(RecordingEnd, IsRightInWhatIsMadeOfRecordings) {
  ASSERT_EQ(run({"anonymise", recorded_simulation(), at("hidden.mcap")}), 0) << log();
  EXPECT_EQ(status_of(at("hidden.mcap")), EndStatus::Right);
  EXPECT_EQ(run({"verify", at("hidden.mcap")}), 0) << log();
  ASSERT_EQ(run({"trim", recorded_simulation(), at("part.mcap"), "--from", "1", "--to", "2"}), 0)
      << log();
  EXPECT_EQ(status_of(at("part.mcap")), EndStatus::Right);
  auto bytes = load_file(recorded_simulation());
  bytes.resize(bytes.size() * 2 / 3);
  save_file(at("killed.mcap"), bytes);
  EXPECT_EQ(status_of(at("killed.mcap")), EndStatus::Unfinished);
  ASSERT_EQ(run({"repair", at("killed.mcap"), at("whole.mcap")}), 0) << log();
  EXPECT_EQ(status_of(at("whole.mcap")), EndStatus::Right);
  EXPECT_EQ(run({"verify", at("whole.mcap")}), kNotVerified) << "it says that it was repaired";
  // Nobody can take that out, either.
  forge(at("whole.mcap"), at("healed.mcap"), kAllMessages, [](const McapMetadata& metadata) {
    return metadata.name != std::string("trocar.repaired");
  });
  expect_changed(at("healed.mcap"), "metadata_sha256: is ");
}

TEST_F(RecordingEnd, IsNotMadeRightByACopy) {
  const auto forged = at("short.mcap");
  const auto last = time_of(1600);
  forge(recorded_simulation(), forged,
        [&](auto&, const McapMessage& message) { return message.log_time <= last; });
  make_keys(at("a.pem"), at("a.pub"));
  EXPECT_EQ(run({"anonymise", forged, at("new.mcap")}), kBadFile);
  EXPECT_EQ(run({"trim", forged, at("new.mcap"), "--to", "1"}), kBadFile);
  EXPECT_EQ(run({"sign", forged, at("new.mcap"), "--key", at("a.pem")}), kBadFile);
  EXPECT_NE(log().find("it was changed since"), std::string::npos) << log();
  EXPECT_FALSE(std::filesystem::exists(at("new.mcap")));
}

// ---- signatures ----

TEST_F(RecordingEnd, IsSignedAndCheckedByItsKey) {
  make_keys(at("a.pem"), at("a.pub"));
  const auto path = at("signed.mcap");
  ASSERT_EQ(run({"sign", recorded_simulation(), path, "--key", at("a.pem")}), 0) << log();
  EXPECT_EQ(run({"verify", path, "--check", at("a.pub")}), 0) << log();
  EXPECT_NE(log().find("signed with the key of " + at("a.pub")), std::string::npos) << log();
  EXPECT_EQ(run({"verify", path}), 0) << log();
  // Nobody's key but that one fits, and none fits a recording without a signature.
  make_keys(at("b.pem"), at("b.pub"));
  EXPECT_EQ(run({"verify", path, "--check", at("b.pub")}), kMismatch);
  EXPECT_NE(log().find("is signed with another key than that of " + at("b.pub")), std::string::npos)
      << log();
  EXPECT_EQ(run({"verify", recorded_simulation(), "--check", at("a.pub")}), kMismatch);
  EXPECT_NE(log().find("recorded.mcap: is not signed"), std::string::npos) << log();
  // Who signs anew replaces the signature.
  ASSERT_EQ(run({"sign", path, at("again.mcap"), "--key", at("b.pem")}), 0) << log();
  EXPECT_EQ(run({"verify", at("again.mcap"), "--check", at("b.pub")}), 0) << log();
}

TEST_F(RecordingEnd, IsSignedByARecorderThatHasAKey) {
  make_keys(at("a.pem"), at("a.pub"));
  const auto key = secure::SigningKey::read(at("a.pem"));
  const auto known = secure::read_public_key(at("a.pub"));
  ASSERT_TRUE(key.ok() && known.ok());
  EXPECT_EQ(key->public_key(), *known);
  const step::Simulation simulation(*catalogue::make_liver(800));
  Beginning beginning;
  beginning.key = *key;
  auto recorder =
      Recorder::create(at("small.mcap"), simulation.organ(), simulation.layout(), beginning);
  ASSERT_TRUE(recorder.ok());
  ASSERT_TRUE((*recorder)->close().ok());
  auto reader = journal::McapReader::open(at("small.mcap"));
  ASSERT_TRUE(reader.ok());
  EXPECT_TRUE(journal::check_signature(**reader, *known, "a.pub").ok());
}

TEST_F(RecordingEnd, OfASignedRecordingCannotBeMadeAnew) {
  make_keys(at("a.pem"), at("a.pub"));
  const auto path = at("signed.mcap"), forged = at("forged.mcap");
  ASSERT_EQ(run({"sign", recorded_simulation(), path, "--key", at("a.pem")}), 0) << log();
  const auto expect_refusal = [&](const std::string& says) {
    EXPECT_EQ(run({"verify", forged, "--check", at("a.pub")}), kMismatch) << log();
    EXPECT_NE(log().find(says), std::string::npos) << log();
    std::filesystem::remove(forged);
  };
  const auto last = time_of(1600);
  const auto is_early = [&](auto&, const McapMessage& message) { return message.log_time <= last; };
  forge(path, forged, is_early);
  expect_refusal("is not what was signed: /claims: ");
  // With an end that fits what is left, the old signature does not fit.
  McapMetadata signature;
  forge(path, forged, kAllMessages, [&](McapMetadata& metadata) {
    if (metadata.name == journal::kSignatureMetadataName) signature = metadata;
    return true;
  });
  std::filesystem::remove(forged);
  auto reader = journal::McapReader::open(recorded_simulation());
  ASSERT_TRUE(reader.ok());
  journal::CopyOptions options;
  options.change = [](const McapChannel&, const McapMessage& message) {
    return Result<BytesView>(message.data.first(message.data.size() / 2));
  };
  options.note = signature;
  ASSERT_TRUE(journal::copy_recording(**reader, forged, options).ok());
  EXPECT_EQ(status_of(forged), EndStatus::Right);
  expect_refusal("its signature is not that of its end");
  // One byte of a message, with all CRCs made anew.
  bool is_changed = false;
  Bytes changed;
  options.change = [&](const McapChannel& channel, const McapMessage& message) {
    changed.assign(message.data.begin(), message.data.end());
    if (channel.topic == "/hands" && !std::exchange(is_changed, true)) changed.back() ^= 1;
    return Result<BytesView>(changed);
  };
  ASSERT_TRUE(journal::copy_recording(**reader, forged, options).ok());
  EXPECT_TRUE(is_changed);
  expect_refusal("its signature is not that of its end");
}

TEST_F(RecordingEnd, NeedsAKeyThatIsOne) {
  make_keys(at("a.pem"), at("a.pub"));
  make_keys(at("other.pem"), at("other.pub"), "X25519");
  save_file(at("text.pem"), bytes_of(std::string_view("no key\n")));
  for (const char* name : {"missing.pem", "text.pem", "other.pem", "a.pub"}) {
    EXPECT_EQ(run({"sign", recorded_simulation(), at("new.mcap"), "--key", at(name)}), kBadFile)
        << name;
    EXPECT_NE(log().find(name), std::string::npos) << log();
    EXPECT_FALSE(std::filesystem::exists(at("new.mcap")));
  }
  for (const char* name : {"missing.pub", "text.pem", "other.pub", "a.pem"})
    EXPECT_EQ(run({"verify", recorded_simulation(), "--check", at(name)}), kBadFile) << name;
  EXPECT_NE(log().find("is no public Ed25519 key"), std::string::npos) << log();
}

}  // namespace
}  // namespace trocar::recording::testing
