// Recordings of sessions that bleed: the blood is simulated again and compared, to the bit.

#include <gtest/gtest.h>

#include <filesystem>

#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/recording/resume.h"
#include "server/session/recording/verify.h"
#include "tests/recording/recorded_simulation.h"
#include "tests/support/files.h"

namespace trocar::recording::testing {
namespace {

using trocar::testing::TemporaryFolder;

class BledRecording : public ::testing::Test {
 protected:
  // Simulated once for all tests.
  static const std::string& sound() {
    static const TemporaryFolder folder;
    static const std::string path = [] {
      auto file = folder.file("bled.mcap");
      record_simulation(file, 0, {.bleeding = bleeding::Rules{}});
      return file;
    }();
    return path;
  }
  static VerifyReport verify(const std::string& path) {
    auto report = verify_journal(path);
    EXPECT_TRUE(report.ok()) << report.error().message;
    return report.ok() ? std::move(*report) : VerifyReport{};
  }
  VerifyReport verify_copy(const Edit& edit) {
    const auto copy = folder_.file("copy.mcap");
    std::filesystem::remove(copy);
    copy_journal(sound(), copy, edit);
    return verify(copy);
  }

  TemporaryFolder folder_;
};

TEST_F(BledRecording, IsVerifiedWhole) {
  const auto report = verify(sound());
  EXPECT_EQ(report.verdict(), Verdict::Verified) << report.why();
  EXPECT_EQ(report.snapshots_verified, 3u);
  EXPECT_EQ(report.bled_surfaces, report.surfaces_decoded);
  EXPECT_GT(report.bled_surfaces, 100u);
}

TEST_F(BledRecording, AChangedLevelIsFound) {
  bool is_changed = false;
  const auto report = verify_copy([&](std::string_view topic, google::protobuf::Message& message) {
    if (topic != "/surface/delta" || is_changed) return true;
    auto& surface = static_cast<proto::SurfaceFrame&>(message);
    if (surface.tick() < 1200 || surface.blood().empty()) return true;
    surface.mutable_blood()->back() ^= 1;
    is_changed = true;
    return true;
  });
  ASSERT_TRUE(is_changed);
  ASSERT_EQ(report.verdict(), Verdict::Different);
  EXPECT_EQ(report.first_difference->channel, "/surface/delta");
  EXPECT_NE(report.first_difference->field.find("blood"), std::string::npos);
}

TEST_F(BledRecording, ChangedRulesAndAChangedLossAreFound) {
  const auto by_rule = verify_copy([&](std::string_view topic, google::protobuf::Message& message) {
    if (topic != "/bleeding") return true;
    auto& rules = static_cast<proto::BleedingRules&>(message);
    rules.set_ooze_m_s(1.01 * rules.ooze_m_s());
    return true;
  });
  EXPECT_EQ(by_rule.verdict(), Verdict::Different);
  const auto by_loss = verify_copy([&](std::string_view topic, google::protobuf::Message& message) {
    if (topic != "/frame_state") return true;
    auto& state = static_cast<proto::FrameState&>(message);
    if (state.tick() == 1600) state.mutable_blood()->set_shed_nl(state.blood().shed_nl() - 1);
    return true;
  });
  ASSERT_EQ(by_loss.verdict(), Verdict::Different);
  EXPECT_EQ(by_loss.first_difference->channel, "/frame_state");
  EXPECT_EQ(by_loss.first_difference->tick, 1600u);
}

TEST_F(BledRecording, WithoutItsRulesItDiffers) {
  const auto report = verify_copy(
      [](std::string_view topic, google::protobuf::Message&) { return topic != "/bleeding"; });
  EXPECT_EQ(report.verdict(), Verdict::Different);
}

TEST_F(BledRecording, RulesThatCannotBeAreRefused) {
  const auto copy = folder_.file("rules.mcap");
  copy_journal(sound(), copy, [](std::string_view topic, google::protobuf::Message& message) {
    if (topic == "/bleeding") static_cast<proto::BleedingRules&>(message).set_ooze_m_s(1e9);
    return true;
  });
  const auto report = verify_journal(copy);
  ASSERT_FALSE(report.ok());
  EXPECT_NE(report.error().message.find("/bleeding: ooze_m_s: is outside"), std::string::npos)
      << report.error().message;
}

// After the gap the blood goes on from the snapshot, and nothing differs.
TEST_F(BledRecording, AfterAGapItGoesOnFromTheNextSnapshot) {
  const auto file = folder_.file("gap.mcap");
  record_simulation(file, 1200, {.bleeding = bleeding::Rules{}});
  const auto report = verify(file);
  EXPECT_EQ(report.verdict(), Verdict::NotVerified) << report.why();
  EXPECT_FALSE(report.first_difference);
  EXPECT_GT(report.frames_verified, 100u);
}

TEST_F(BledRecording, ASessionGoesOnWithItsBlood) {
  auto resumed = resume_session(sound(), {});
  ASSERT_TRUE(resumed.ok()) << resumed.error().message;
  const auto& blood = resumed->simulation.state().blood;
  ASSERT_TRUE(blood);
  auto journal = journal::SessionJournal::open(sound());
  ASSERT_TRUE(journal.ok());
  std::uint32_t last_crc = 0;
  const auto visit = [&](Tick, const proto::SurfaceFrame& frame) {
    last_crc = frame.blood_crc();
    return true;
  };
  ASSERT_TRUE((*journal)->read_surface_deltas(0, kRecordedTicks, visit).ok());
  EXPECT_EQ(wire::blood_crc(blood->levels), last_crc);
  EXPECT_GT(blood->shed_pl, 0);
}

}  // namespace
}  // namespace trocar::recording::testing
