// Two recordings beside each other: one time for both, and what is wrong with one stops it alone.

#include "client/replay/paired_source.h"

#include <chrono>
#include <filesystem>
#include <optional>
#include <thread>

#include "tests/replay/recorded_session.h"

namespace trocar::replay::testing {
namespace {

using journal::JournalTopic;
using replica::SourceState;

class PairedSourceTest : public ::testing::Test {
 protected:
  void open(const RecordingOptions& first, const RecordingOptions& second,
            std::optional<Alignment> wish = Alignment::Start) {
    for (const auto& path : paths_) std::filesystem::remove(path);
    truth_ = {record_session(paths_[0], first), record_session(paths_[1], second)};
    auto opened = PairedSource::open(paths_[0], paths_[1], wish, [this] { return now_ns_; });
    ASSERT_TRUE(opened.ok()) << opened.error().message;
    pair_ = std::move(*opened);
    for (std::size_t i = 0; i < kPair; ++i)
      replicas_[i].emplace([this, i](const proto::Envelope& m) { return pair_->half(i).send(m); });
  }
  void step(std::uint64_t milliseconds) {
    now_ns_ += milliseconds * 1'000'000;
    pair_->poll(*replicas_[0]);
    pair_->poll_second(*replicas_[1]);
  }
  // The files are read by threads of their own.
  void wait_for_stories() {
    while (!pair_->has_stages()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      step(0);
    }
  }
  void expect_truth(std::size_t i) {
    const auto* newest = replicas_[i]->newest();
    ASSERT_NE(newest, nullptr);
    EXPECT_EQ(newest->frame, pair_->half(i).position() / kTicksPerFrame) << i;
    EXPECT_EQ(replicas_[i]->surface_crc(), truth_[i].crc[newest->frame]) << i;
  }
  // Both are where one time says, to within a frame.
  void expect_aligned() {
    for (std::size_t i = 0; i < kPair; ++i) {
      const auto wanted = static_cast<double>(pair_->place(i).tick);
      EXPECT_NEAR(static_cast<double>(pair_->half(i).position()), wanted, kTicksPerFrame)
          << i << " at " << pair_->position();
    }
  }

  TemporaryFolder folder_;
  std::array<std::string, kPair> paths_{folder_.file("a.mcap"), folder_.file("b.mcap")};
  std::array<Truth, kPair> truth_;
  std::uint64_t now_ns_ = 1'000'000'000;
  std::unique_ptr<PairedSource> pair_;
  std::array<std::optional<replica::Replica>, kPair> replicas_;
};

TEST_F(PairedSourceTest, BothPlayOnOneTimeAndTheShorterOneEnds) {
  open({.frames = 300}, {.frames = 120});
  step(0);
  for (int i = 0; i < 100; ++i) {
    step(16);
    expect_aligned();
    for (std::size_t half = 0; half < kPair; ++half) ASSERT_NO_FATAL_FAILURE(expect_truth(half));
    EXPECT_FALSE(pair_->place(1).has_ended);
  }
  while (pair_->is_playing()) step(16);
  EXPECT_TRUE(pair_->place(1).has_ended);
  EXPECT_EQ(pair_->position(), pair_->last_tick());
  for (std::size_t half = 0; half < kPair; ++half) {
    EXPECT_EQ(pair_->half(half).position(), pair_->half(half).last_tick());
    ASSERT_NO_FATAL_FAILURE(expect_truth(half));
  }
  pair_->play();  // from the start again
  step(0);
  step(160);
  EXPECT_EQ(pair_->position(), 160u);
  expect_aligned();
}

TEST_F(PairedSourceTest, SeekPauseAndSpeedActOnBoth) {
  open({.frames = 300, .cut_every = 40}, {.frames = 200, .cut_every = 25});
  step(0);
  for (const Tick target : {Tick{2000}, Tick{300}, Tick{4000}, Tick{0}, Tick{1500}}) {
    pair_->pause();
    pair_->seek(target);
    step(16);
    EXPECT_EQ(pair_->position(), std::min(target, pair_->last_tick()));
    for (std::size_t half = 0; half < kPair; ++half) {
      EXPECT_EQ(pair_->half(half).position(), pair_->place(half).tick);
      ASSERT_NO_FATAL_FAILURE(expect_truth(half));
    }
    step(500);
    EXPECT_EQ(pair_->position(), std::min(target, pair_->last_tick())) << "it is paused";
  }
  for (const float speed : {4.0f, 0.25f, 1.0f}) {
    pair_->seek(200);
    pair_->set_speed(speed);
    pair_->play();
    step(0);
    for (int i = 0; i < 20; ++i) step(16);
    EXPECT_NEAR(static_cast<double>(pair_->position()), 200 + 320 * double{speed}, 1);
    expect_aligned();
  }
}

TEST_F(PairedSourceTest, StagesBeginTogetherWhereBothHaveThem) {
  open({.frames = 300, .stage_at = 50}, {.frames = 300, .stage_at = 120}, std::nullopt);
  wait_for_stories();
  ASSERT_TRUE(pair_->has_stages().value());
  EXPECT_EQ(pair_->alignment(), Alignment::Stage);
  pair_->seek(0);
  step(0);
  bool has_waited = false;
  while (pair_->is_playing()) {
    step(16);
    expect_aligned();
    if (pair_->place(0).is_waiting && pair_->place(0).tick < 60 * kTicksPerFrame) {
      step(0);
      EXPECT_FALSE(replicas_[0]->told().lesson()) << "its stage has not begun";
    }
    has_waited = has_waited || (pair_->place(0).is_waiting && !pair_->place(0).has_ended);
    const auto lessons = std::array{replicas_[0]->told().lesson(), replicas_[1]->told().lesson()};
    if (pair_->position() % kTicksPerFrame == 0 && lessons[0] && lessons[1]) {
      EXPECT_EQ(lessons[0]->is_over, lessons[1]->is_over) << pair_->position();
    }
  }
  EXPECT_TRUE(has_waited);
  // Marks of both stand on the one time, and stages on the same place.
  const auto& events = pair_->story()->events;
  std::vector<Tick> begins;
  for (const auto& event : events)
    if (event.text.ends_with("stage: Search")) begins.push_back(event.tick);
  ASSERT_EQ(begins.size(), 2u);
  EXPECT_EQ(begins[0], begins[1]);
  pair_->align(Alignment::Start);
  EXPECT_EQ(pair_->alignment(), Alignment::Start);
  EXPECT_EQ(pair_->last_tick(), pair_->half(1).last_tick() - pair_->half(1).first_tick());
}

TEST_F(PairedSourceTest, WithoutStagesBothRunFromTheirStart) {
  open({.frames = 100, .stage_at = 20}, {.frames = 100}, Alignment::Stage);
  wait_for_stories();
  EXPECT_FALSE(pair_->has_stages().value());
  EXPECT_EQ(pair_->alignment(), Alignment::Start);
}

TEST_F(PairedSourceTest, DamageInOneDoesNotStopTheOther) {
  for (const std::size_t damaged : {0u, 1u}) {
    RecordingOptions bad{.frames = 200};
    bad.tamper = [](JournalTopic topic, Frame frame, Bytes& data) {
      if (topic == JournalTopic::SurfaceDelta && frame == 90) data.assign(data.size(), 0xff);
      return true;
    };
    open(damaged == 0 ? bad : RecordingOptions{.frames = 200},
         damaged == 1 ? bad : RecordingOptions{.frames = 200});
    step(0);
    while (pair_->is_playing()) step(16);
    EXPECT_EQ(pair_->state(), SourceState::Live);
    EXPECT_NE(pair_->why_stopped(damaged).find("malformed"), std::string::npos)
        << pair_->why_stopped(damaged);
    EXPECT_EQ(pair_->why_stopped(damaged).find('\n'), std::string::npos);
    EXPECT_TRUE(pair_->why_stopped(1 - damaged).empty());
    EXPECT_EQ(pair_->half(1 - damaged).position(), pair_->half(1 - damaged).last_tick());
    pair_->seek(100);
    step(16);
    EXPECT_EQ(pair_->half(1 - damaged).position(), pair_->place(1 - damaged).tick);
    pair_->stop(1 - damaged, "that one, too");
    EXPECT_EQ(pair_->state(), SourceState::Closed);
  }
}

TEST_F(PairedSourceTest, AFileThatIsNoneIsRefusedByName) {
  record_session(paths_[0], {.frames = 20});
  save_file(paths_[1], Bytes{1, 2, 3});
  for (const auto& [first, second] : {std::pair{0, 1}, {1, 0}}) {
    const auto opened = PairedSource::open(paths_[static_cast<std::size_t>(first)],
                                           paths_[static_cast<std::size_t>(second)], {});
    ASSERT_FALSE(opened.ok());
    EXPECT_NE(opened.error().message.find("b.mcap"), std::string::npos);
    EXPECT_EQ(opened.error().message.find('\n'), std::string::npos);
  }
}

}  // namespace
}  // namespace trocar::replay::testing
