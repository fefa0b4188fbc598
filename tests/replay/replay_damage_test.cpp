// A damaged, truncated or foreign file never gives a replay a wrong picture and never crashes it.

#include <random>

#include "tests/replay/recorded_session.h"

namespace trocar::replay::testing {
namespace {

using journal::JournalTopic;
using replica::SourceState;

class ReplayDamageTest : public ::testing::Test {
 protected:
  // Plays to the end, then seeks about; returns the frames that were seen in step with play.
  int play_through(Player& player, const Truth& truth, std::uint32_t seed) {
    int in_step = 0;
    player.step(0);
    while (player.source->is_playing() && !::testing::Test::HasFatalFailure()) {
      player.step(16);
      player.expect_honest(truth);
      const auto* newest = player.replica.newest();
      if (newest != nullptr && player.source->state() == SourceState::Live &&
          newest->frame == player.source->position() / kTicksPerFrame)
        ++in_step;
    }
    std::mt19937 random(seed);
    for (int i = 0; i < 40 && !::testing::Test::HasFatalFailure(); ++i) {
      player.source->seek(random() % (player.source->last_tick() + 1));
      player.step(5);
      player.expect_honest(truth);
    }
    return in_step;
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.file("session.mcap");
};

TEST_F(ReplayDamageTest, RecordingGapStandsStillUntilTheNextKeyframe) {
  RecordingOptions options{.frames = 300};
  options.tamper = [](JournalTopic topic, Frame frame, Bytes&) {
    return topic == JournalTopic::Topology || topic == JournalTopic::Participants || frame < 100 ||
           frame > 110;
  };
  const Truth truth = record_session(path_, options);
  Player player(path_);
  player.step(0);
  for (Frame frame = 2; frame <= 300; ++frame) {
    player.step(16);
    ASSERT_NO_FATAL_FAILURE(player.expect_honest(truth));
    const bool stands_still = frame >= 100 && frame < 1 + 2 * kFramesPerKey;
    ASSERT_EQ(player.replica.newest()->frame, stands_still ? 99u : frame);
  }
  // The replica is not bothered: it never sees a delta that it cannot use.
  EXPECT_EQ(player.replica.counters().base_mismatches, 0u);
  EXPECT_EQ(player.replica.counters().deltas_ignored, 0u);
  player.source->seek(120 * 16);
  player.step(0);
  ASSERT_NO_FATAL_FAILURE(player.expect_honest(truth));
  EXPECT_EQ(player.replica.newest()->frame, 99u);
  EXPECT_TRUE(player.replica.newest()->has_state);
}

TEST_F(ReplayDamageTest, UnfinishedRecordingPlays) {
  const Truth truth = record_session(path_, {.frames = 200, .is_finished = false});
  Player player(path_);
  ASSERT_TRUE(player.opened.ok()) << player.opened.error().message;
  EXPECT_FALSE(player.source->info().is_finished);
  EXPECT_EQ(play_through(player, truth, 3), 199);
  ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
}

TEST_F(ReplayDamageTest, FileCutAnywhereOpensOrSaysWhyNot) {
  const Truth truth = record_session(path_, {.frames = 120, .cut_at = 70});
  const Bytes whole = load_file(path_);
  std::mt19937 random(11);
  int opened = 0;
  for (int i = 0; i < 60; ++i) {
    const std::string cut = folder_.file("cut" + std::to_string(i) + ".mcap");
    save_file(cut, BytesView(whole).first(random() % whole.size()));
    Player player(cut);
    if (!player.opened.ok()) {
      EXPECT_NE(player.opened.error().message.find(cut), std::string::npos);
      EXPECT_EQ(player.opened.error().message.find('\n'), std::string::npos);
      continue;
    }
    ++opened;
    const Frame last = static_cast<Frame>(player.source->last_tick() / kTicksPerFrame);
    // Each frame from the second to the last that was recovered.
    EXPECT_EQ(play_through(player, truth, i), std::max<int>(1, static_cast<int>(last) - 1));
    ASSERT_FALSE(HasFatalFailure());
    EXPECT_EQ(player.source->state(), SourceState::Live) << player.source->close_reason().text;
  }
  EXPECT_GT(opened, 20);
  EXPECT_LT(opened, 60);
}

TEST_F(ReplayDamageTest, DamagedChunkCostsItsOwnPartOnly) {
  const Truth truth = record_session(path_, {.frames = 400});
  const Bytes whole = load_file(path_);
  const auto reader = journal::McapReader::open(path_);
  ASSERT_TRUE(reader.ok());
  const auto chunks = (*reader)->chunks();
  ASSERT_GT(chunks.size(), 20u);
  for (std::size_t i = 1; i < chunks.size(); ++i) {
    Bytes bytes = whole;
    bytes[chunks[i].chunk_offset + chunks[i].chunk_length / 2] ^= 0x55;
    const std::string damaged = folder_.file("damaged" + std::to_string(i) + ".mcap");
    save_file(damaged, bytes);
    Player player(damaged);
    ASSERT_TRUE(player.opened.ok()) << player.opened.error().message;
    const int in_step = play_through(player, truth, static_cast<std::uint32_t>(i));
    ASSERT_FALSE(HasFatalFailure());
    EXPECT_EQ(player.source->state(), SourceState::Live) << player.source->close_reason().text;
    // A quarter of a second is gone, and at most what follows until two keyframes later.
    EXPECT_LT(in_step, 400) << "chunk " << i;
    EXPECT_GE(in_step, 399 - 2 * static_cast<int>(kFramesPerKey) - 16) << "chunk " << i;
  }
}

TEST_F(ReplayDamageTest, MalformedMessagesCloseWithOneLine) {
  for (const JournalTopic topic :
       {JournalTopic::SurfaceDelta, JournalTopic::SurfaceKey, JournalTopic::Topology,
        JournalTopic::FrameState, JournalTopic::Claims, JournalTopic::Participants}) {
    SCOPED_TRACE(journal::topic_name(topic));
    const std::string file = folder_.file(std::to_string(static_cast<int>(topic)) + ".mcap");
    RecordingOptions options{.frames = 200, .cut_at = 125, .claim_at = 125, .join_at = 125};
    // The last of each topic that is in the file at or before frame 125 is not a message.
    options.tamper = [topic](JournalTopic of, Frame frame, Bytes& bytes) {
      if (of == topic && frame >= 100) bytes = {0x0a, 0xff, 0xff, 0xff};
      return true;
    };
    const Truth truth = record_session(file, options);
    Player player(file);
    ASSERT_TRUE(player.opened.ok()) << player.opened.error().message;
    player.step(0);
    while (player.source->is_playing()) {
      player.step(16);
      ASSERT_NO_FATAL_FAILURE(player.expect_honest(truth));
    }
    EXPECT_EQ(player.source->state(), SourceState::Closed);
    const auto reason = player.source->close_reason();
    EXPECT_EQ(reason.kind, replica::CloseKind::Lost);
    EXPECT_NE(reason.text.find(file), std::string::npos) << reason.text;
    EXPECT_NE(reason.text.find(journal::topic_name(topic)), std::string::npos) << reason.text;
    EXPECT_EQ(reason.text.find('\n'), std::string::npos);
    player.step(16);
  }
}

TEST_F(ReplayDamageTest, FrameOfAnotherTickClosesTheSource) {
  RecordingOptions options{.frames = 100};
  options.tamper = [](JournalTopic topic, Frame frame, Bytes& bytes) {
    proto::SurfaceFrame message;
    if (topic != JournalTopic::SurfaceDelta || frame != 50) return true;
    message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
    message.set_tick(message.tick() + 1);
    bytes.resize(message.ByteSizeLong());
    message.SerializeToArray(bytes.data(), static_cast<int>(bytes.size()));
    return true;
  };
  const Truth truth = record_session(path_, options);
  Player player(path_);
  EXPECT_EQ(play_through(player, truth, 1), 48);  // frames 2 to 49
  EXPECT_EQ(player.source->state(), SourceState::Closed);
  EXPECT_EQ(player.replica.newest()->frame, 49u);
}

// A frame that was written with the time of a later one.
TEST_F(ReplayDamageTest, ALateFrameIsLeftOutAndTheNextKeyframeGoesOn) {
  RecordingOptions options{.frames = 300};
  options.tamper = [](JournalTopic topic, Frame frame, Bytes& bytes) {
    proto::SurfaceFrame message;
    if (topic != JournalTopic::SurfaceDelta || frame != 50) return true;
    message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
    message.set_tick(message.tick() - kTicksPerFrame);
    bytes.resize(message.ByteSizeLong());
    message.SerializeToArray(bytes.data(), static_cast<int>(bytes.size()));
    return true;
  };
  const Truth truth = record_session(path_, options);
  Player player(path_);
  bool has_stood = false;
  for (player.step(0); player.source->is_playing(); player.step(16)) {
    player.expect_honest(truth);
    const auto* newest = player.replica.newest();
    has_stood |= newest != nullptr && newest->frame < player.source->position() / kTicksPerFrame;
  }
  EXPECT_TRUE(has_stood);
  EXPECT_EQ(player.source->state(), SourceState::Live);
  EXPECT_EQ(player.replica.newest()->frame, truth.last_frame);
}

// Bytes changed inside messages whose chunk is sound: a file that somebody made.
TEST_F(ReplayDamageTest, ChangedMessagesNeverCrashNorShowAWrongSurface) {
  for (std::uint32_t seed = 1; seed <= 60; ++seed) {
    const std::string file = folder_.file("fuzz" + std::to_string(seed) + ".mcap");
    std::mt19937 random(seed);
    RecordingOptions options{.frames = 130, .claim_at = 30, .join_at = 40};
    (seed % 2 ? options.cut_at : options.cut_every) = seed % 2 ? 80 : 9;
    options.tamper = [&random](JournalTopic, Frame, Bytes& bytes) {
      if (random() % 60 == 0 && !bytes.empty())
        for (int k = 0; k < 3; ++k)
          bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
      return random() % 100 != 0;
    };
    record_session(file, options);
    Player player(file);
    if (!player.opened.ok()) continue;
    player.step(0);
    for (int i = 0; i < 200; ++i) {
      if (random() % 10 == 0) player.source->seek(random() % 2300);
      if (random() % 10 == 0) player.source->play();
      player.step(random() % 50);
    }
    EXPECT_LE(player.source->position(), player.source->last_tick());
  }
}

TEST_F(ReplayDamageTest, RefusesWhatItCannotPlay) {
  EXPECT_FALSE(ReplaySource::open(folder_.file("absent.mcap")).ok());

  RecordingOptions no_keys{.frames = 30};
  no_keys.tamper = [](JournalTopic topic, Frame, Bytes&) {
    return topic != JournalTopic::SurfaceKey;
  };
  const std::string without = folder_.file("without.mcap");
  record_session(without, no_keys);
  const auto no_key = ReplaySource::open(without);
  ASSERT_FALSE(no_key.ok());
  EXPECT_NE(no_key.error().message.find("no keyframe"), std::string::npos);

  const std::string later = folder_.file("later.mcap");
  record_session(later, {.frames = 30, .protocol_major = kProtocolMajor + 1});
  const auto other = ReplaySource::open(later);
  ASSERT_FALSE(other.ok());
  EXPECT_NE(other.error().message.find("use the release"), std::string::npos);
}

}  // namespace
}  // namespace trocar::replay::testing
