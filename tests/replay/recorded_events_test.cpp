#include "client/replay/recorded_events.h"

#include "tests/replay/recorded_session.h"

namespace trocar::replay::testing {
namespace {

const std::atomic<bool> kGoesOn{false};

TEST(RecordedEvents, TellWhoCameAndWhoWasRefused) {
  const TemporaryFolder folder;
  const std::string path = folder.file("told.mcap");
  record_session(path, {.frames = 200, .claim_at = 100, .join_at = 50});
  const auto story = read_story(path, kGoesOn).story;
  ASSERT_EQ(story.events.size(), 3u);
  EXPECT_EQ(story.events[0].text, "Mira joined");
  EXPECT_EQ(story.events[1].text, "Jonas joined");
  EXPECT_EQ(story.events[1].tick, 50 * kTicksPerFrame);
  EXPECT_EQ(story.events[2].text, "grasp refused: Mira holds this tissue");
  EXPECT_EQ(story.events[2].kind, replica::PlaybackEventKind::Refusal);
  EXPECT_EQ(story.events[2].tick, 100 * kTicksPerFrame);
  EXPECT_EQ(story.forces_n.size(), kForceBins);
}

TEST(RecordedEvents, AFileThatIsNoRecordingHasNone) {
  const TemporaryFolder folder;
  const std::string path = folder.file("none.mcap");
  save_file(path, Bytes(100, 7));
  EXPECT_TRUE(read_story(path, kGoesOn).story.events.empty());
}

TEST(RecordedEvents, MessagesThatDoNotParseEndTheListAndNothingElse) {
  const TemporaryFolder folder;
  const std::string path = folder.file("bad.mcap");
  RecordingOptions options{.frames = 200, .claim_at = 100, .join_at = 50};
  options.tamper = [](journal::JournalTopic topic, Frame, Bytes& bytes) {
    if (topic == journal::JournalTopic::Claims) bytes.assign(5, 0xff);
    return true;
  };
  record_session(path, options);
  EXPECT_EQ(read_story(path, kGoesOn).story.events.size(), 2u);
}

TEST(RecordedEvents, ComeWhileTheRecordingPlays) {
  const TemporaryFolder folder;
  const std::string path = folder.file("plays.mcap");
  record_session(path, {.frames = 200, .join_at = 50});
  Player player(path);
  for (int i = 0; i < 500 && player.source->story() == nullptr; ++i) {
    player.step(1);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  ASSERT_NE(player.source->story(), nullptr);
  EXPECT_EQ(player.source->story()->events.size(), 2u);
}

}  // namespace
}  // namespace trocar::replay::testing
