#include "client/replay/replay_source.h"

#include <chrono>
#include <cmath>
#include <limits>
#include <random>
#include <thread>

#include "tests/replay/recorded_session.h"

namespace trocar::replay::testing {
namespace {

using replica::SourceState;

class ReplaySourceTest : public ::testing::Test {
 protected:
  Truth record(const RecordingOptions& options) { return record_session(path_, options); }

  TemporaryFolder folder_;
  std::string path_ = folder_.file("session.mcap");
};

TEST_F(ReplaySourceTest, PlaysEveryFrameBitForBit) {
  const Truth truth = record({.frames = 300, .cut_at = 150, .claim_at = 90, .join_at = 200});
  Player player(path_);
  ASSERT_TRUE(player.opened.ok()) << player.opened.error().message;
  EXPECT_EQ(player.source->state(), SourceState::Live);
  EXPECT_EQ(player.source->name(), "session.mcap");
  EXPECT_EQ(player.source->first_tick(), 16u);
  EXPECT_EQ(player.source->last_tick(), 300u * 16);
  for (Frame frame = 1; frame <= 300; ++frame) {
    player.step(frame == 1 ? 0 : 16);
    ASSERT_EQ(player.source->position(), frame * kTicksPerFrame);
    ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
    ASSERT_EQ(player.replica.newest()->arrival_ns, player.now_ns);
    ASSERT_EQ(player.replica.told().notice_count(), frame >= 90 ? 1u : 0u);
    ASSERT_EQ(player.replica.told().participants().size(), frame >= 200 ? 2u : 1u);
  }
  // The observer has a slot that nobody in the recording had.
  EXPECT_EQ(player.replica.own_slot().value, kMaxHands + 1);
  const auto& counters = player.replica.counters();
  EXPECT_EQ(counters.frames, 300u);
  EXPECT_EQ(counters.keyframes, 2u);  // the first, and that of the cut
  EXPECT_EQ(counters.crc_mismatches + counters.base_mismatches + counters.deltas_ignored, 0u);
  EXPECT_EQ(player.source->statistics().frames_received, 300u);
  EXPECT_EQ(player.source->statistics().bytes_received, counters.bytes);
}

TEST_F(ReplaySourceTest, ShowsTheOrgansFineSurface) {
  const Truth truth = record({.frames = 100, .has_fine_surface = true});
  Player player(path_);
  player.step(0);
  ASSERT_NE(player.replica.fine_surface(), nullptr);
  EXPECT_EQ(player.replica.fine_surface()->triangles.size(), 1u);
  player.source->seek(50 * kTicksPerFrame);
  player.step(0);
  ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
  EXPECT_NE(player.replica.fine_surface(), nullptr);
}

TEST_F(ReplaySourceTest, AFineSurfaceThatIsNoneIsLeftOut) {
  const Truth truth = record({.frames = 100,
                              .has_fine_surface = true,
                              .tamper = [](journal::JournalTopic topic, Frame, Bytes& bytes) {
                                // The last corner's step.
                                if (topic == journal::JournalTopic::Organ) bytes.back() = 0x7f;
                                return true;
                              }});
  Player player(path_);
  player.step(0);
  EXPECT_EQ(player.replica.fine_surface(), nullptr);
  ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
}

TEST_F(ReplaySourceTest, AnOrganThatTakesTooMuchMemoryIsLeftOut) {
  proto::Organ many;
  for (int i = 0; i < 400'000; ++i) many.add_region();
  const std::string more = many.SerializeAsString();
  const Truth truth = record({.frames = 100,
                              .has_fine_surface = true,
                              .tamper = [&](journal::JournalTopic topic, Frame, Bytes& bytes) {
                                if (topic == journal::JournalTopic::Organ)
                                  bytes.insert(bytes.end(), more.begin(), more.end());
                                return true;
                              }});
  Player player(path_);
  player.step(0);
  EXPECT_EQ(player.replica.fine_surface(), nullptr);
  ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
}

TEST_F(ReplaySourceTest, UnevenPollsMissNothing) {
  const Truth truth = record({.frames = 400, .cut_at = 133});
  Player player(path_);
  std::mt19937 random(7);
  player.step(0);
  while (player.source->is_playing()) {
    player.step(random() % 20 == 0 ? 2500 : random() % 40);
    ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
  }
  EXPECT_EQ(player.replica.counters().frames, 400u);
}

TEST_F(ReplaySourceTest, SeeksToAnyTickForwardAndBack) {
  const Truth truth = record({.frames = 700, .cut_at = 333, .join_at = 200});
  Player player(path_);
  player.step(0);
  player.source->pause();
  std::mt19937 random(1);
  for (int i = 0; i < 400; ++i) {
    const Tick target = 16 + random() % (699 * 16 + 1);
    player.source->seek(target);
    player.step(3);
    ASSERT_EQ(player.source->position(), target);
    ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth)) << "seek " << i << " to " << target;
    ASSERT_EQ(player.replica.told().participants().size(), target >= 200 * 16 ? 2u : 1u);
    ASSERT_LE(player.replica.newest()->arrival_ns, player.now_ns);
    if (i % 4 != 0) continue;
    player.source->play();
    for (int k = 0; k < 5; ++k) {
      player.step(16);
      ASSERT_EQ(player.source->position(), std::min<Tick>(target + 16 * (k + 1), 700 * 16));
      ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth)) << "after " << target;
    }
    player.source->pause();
  }
  const auto& counters = player.replica.counters();
  EXPECT_EQ(counters.crc_mismatches + counters.base_mismatches + counters.deltas_ignored, 0u);
}

TEST_F(ReplaySourceTest, PlaysASurfaceThatIsCutAllTheTime) {
  const Truth truth = record({.frames = 300, .cut_every = 1});
  Player player(path_);
  for (Frame frame = 1; frame <= 300; ++frame) {
    player.step(frame == 1 ? 0 : 16);
    ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth)) << frame;
  }
  const auto& counters = player.replica.counters();
  EXPECT_EQ(counters.keyframes, 1u);
  EXPECT_EQ(counters.surface_changes, 299u) << "the first comes with the topology";
  EXPECT_EQ(counters.change_mismatches + counters.base_mismatches + counters.deltas_ignored, 0u);
}

TEST_F(ReplaySourceTest, SeeksToTheRightTopologyForwardAndBack) {
  const Truth truth = record({.frames = 500, .cut_every = 7});
  Player player(path_);
  player.step(0);
  player.source->pause();
  std::mt19937 random(2);
  for (int i = 0; i < 200; ++i) {
    const Tick target = 16 + random() % (499 * 16 + 1);
    player.source->seek(target);
    player.step(3);
    ASSERT_EQ(player.source->position(), target);
    ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth)) << "seek " << i << " to " << target;
    if (i % 4 != 0) continue;
    player.source->play();
    for (int k = 0; k < 12; ++k) {
      player.step(16);
      ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth)) << "after " << target;
    }
    player.source->pause();
  }
  const auto& counters = player.replica.counters();
  EXPECT_EQ(counters.change_mismatches + counters.base_mismatches + counters.deltas_ignored, 0u);
}

// A change that is lost or does not add up costs the picture until the next keyframe, no more.
TEST_F(ReplaySourceTest, ALostOrDamagedChangeHealsAtTheNextKeyframe) {
  for (const bool is_lost : {true, false}) {
    const std::string path = folder_.file(is_lost ? "lost.mcap" : "damaged.mcap");
    const Truth truth = record_session(
        path, {.frames = 200, .cut_every = 10, .tamper = [&](auto topic, Frame frame, Bytes& b) {
                 if (topic != journal::JournalTopic::TopologyChange || frame != 80) return true;
                 b.back() ^= 0x40;  // of the sum
                 return !is_lost;
               }});
    Player player(path);
    for (Frame frame = 1; frame <= 200; ++frame) {
      player.step(frame == 1 ? 0 : 16);
      ASSERT_NO_FATAL_FAILURE(player.expect_honest(truth)) << frame;
      const Frame expected = frame < 80 || frame >= 125 ? frame : 79;
      ASSERT_EQ(player.replica.newest()->frame, expected) << is_lost;
    }
    ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
    // Seeking past it finds nothing wrong.
    player.source->seek(130 * 16);
    player.step(0);
    ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
  }
}

TEST_F(ReplaySourceTest, SeekDeliversOneKeyframeAndNoClaims) {
  const Truth truth = record({.frames = 300, .claim_at = 250});
  Player player(path_);
  player.step(0);
  player.source->seek(290 * 16);
  player.source->seek(280 * 16);  // the last one counts
  EXPECT_EQ(player.source->position(), 16u);
  player.step(0);
  ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
  EXPECT_EQ(player.replica.newest()->frame, 280u);
  EXPECT_EQ(player.replica.counters().keyframes, 2u);
  EXPECT_EQ(player.replica.counters().frames, 1u + (280 - 249) + 1);
  EXPECT_EQ(player.replica.told().notice_count(), 0u);
  // All that the replica remembers has its state, and the times lie a frame apart.
  const auto& history = player.replica.history();
  ASSERT_EQ(history.size(), replica::kHistoryFrames);
  for (std::size_t i = 0; i < history.size(); ++i) {
    EXPECT_TRUE(history[i].has_state);
    EXPECT_EQ(history[i].arrival_ns, player.now_ns - (history.size() - 1 - i) * 16'000'000);
  }
  player.source->seek(std::numeric_limits<Tick>::max());
  player.step(0);
  EXPECT_EQ(player.source->position(), 300u * 16);
  player.source->seek(0);
  player.step(0);
  EXPECT_EQ(player.source->position(), 16u);
  ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
}

TEST_F(ReplaySourceTest, PauseHoldsAndPlayGoesOnFromThere) {
  const Truth truth = record({.frames = 200});
  Player player(path_);
  player.step(0);
  player.step(320);
  EXPECT_EQ(player.source->position(), 336u);
  player.source->pause();
  EXPECT_FALSE(player.source->is_playing());
  const auto messages = player.source->statistics().messages_received;
  player.step(5000);
  EXPECT_EQ(player.source->position(), 336u);
  EXPECT_EQ(player.source->statistics().messages_received, messages);
  player.source->play();
  player.step(0);
  EXPECT_EQ(player.source->position(), 336u);
  player.step(32);
  EXPECT_EQ(player.source->position(), 368u);
  ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
}

TEST_F(ReplaySourceTest, EndPausesStaysLiveAndPlayStartsAgain) {
  const Truth truth = record({.frames = 100});
  Player player(path_);
  player.step(0);
  player.step(10'000);
  EXPECT_EQ(player.source->state(), SourceState::Live);
  EXPECT_FALSE(player.source->is_playing());
  EXPECT_EQ(player.source->position(), 1600u);
  ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
  player.step(1000);
  player.source->play();
  EXPECT_TRUE(player.source->is_playing());
  player.step(0);
  EXPECT_EQ(player.source->position(), 16u);
  ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
  player.step(160);
  EXPECT_EQ(player.source->position(), 176u);
  ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
  // A seek away from the end is not undone by play.
  player.step(10'000);
  player.source->seek(800);
  player.source->play();
  player.step(0);
  EXPECT_EQ(player.source->position(), 800u);
}

TEST_F(ReplaySourceTest, SpeedIsClampedAndKeepsThePlace) {
  const Truth truth = record({.frames = 400});
  Player player(path_);
  player.step(0);
  player.source->set_speed(10);
  player.step(16);
  EXPECT_EQ(player.source->position(), 16u + 160);
  ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
  player.source->set_speed(0.5f);
  player.step(32);
  EXPECT_EQ(player.source->position(), 16u + 160 + 16);
  player.source->set_speed(100);
  EXPECT_EQ(player.source->speed(), 16.0f);
  player.source->set_speed(0);
  EXPECT_EQ(player.source->speed(), 0.1f);
  player.source->set_speed(std::nanf(""));
  EXPECT_EQ(player.source->speed(), 0.1f);
  player.step(170);
  EXPECT_EQ(player.source->position(), 192u + 17);
  ASSERT_NO_FATAL_FAILURE(player.expect_truth(truth));
}

TEST_F(ReplaySourceTest, WhatTheReplicaCouldNotUseHealsAtTheNextKeyframe) {
  const Truth truth = record({.frames = 200});
  Player player(path_);
  player.replica.corrupt_delta(20);
  player.step(0);
  for (Frame frame = 2; frame <= 200; ++frame) {
    player.step(16);
    ASSERT_NO_FATAL_FAILURE(player.expect_honest(truth));
    const bool is_healing = frame >= 21 && frame < 1 + kFramesPerKey;
    ASSERT_EQ(player.replica.newest()->frame, is_healing ? 20u : frame);
  }
  EXPECT_EQ(player.replica.counters().healed, 1u);
}

TEST_F(ReplaySourceTest, SaysWhichStageOfALessonWasOn) {
  record({.frames = 400, .stage_at = 100});
  Player player(path_);
  player.step(0);
  player.source->pause();
  while (!player.source->story()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  for (const Frame frame : {150u, 250u, 50u, 100u, 99u, 200u}) {
    player.source->seek(frame * kTicksPerFrame);
    player.step(3);
    ASSERT_TRUE(player.replica.fault().ok()) << player.replica.fault().error().message;
    const auto& lesson = player.replica.told().lesson();
    ASSERT_EQ(lesson.has_value(), frame >= 100) << frame;
    if (!lesson) continue;
    EXPECT_EQ(lesson->name, "Search");
    EXPECT_EQ(lesson->is_over, frame >= 200) << frame;
  }
}

TEST_F(ReplaySourceTest, ClosesOnRequestAndSwallowsWhatIsSent) {
  record({.frames = 50});
  Player player(path_);
  player.step(0);
  proto::Envelope sample;
  sample.mutable_tool_sample();
  EXPECT_TRUE(player.source->send(sample));
  EXPECT_EQ(player.source->playback(), player.source.get());
  player.source->close("the window was closed");
  EXPECT_EQ(player.source->state(), SourceState::Closed);
  EXPECT_EQ(player.source->close_reason().kind, replica::CloseKind::Ended);
  const auto messages = player.source->statistics().messages_received;
  player.source->seek(160);
  player.source->play();
  player.step(500);
  EXPECT_EQ(player.source->statistics().messages_received, messages);
}

}  // namespace
}  // namespace trocar::replay::testing
