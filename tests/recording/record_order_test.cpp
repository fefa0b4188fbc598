// A list of people may come while frames wait for the writer: each frame keeps its own time.

#include <gtest/gtest.h>

#include <memory>
#include <thread>

#include "common/journal/session_journal.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/session/recording/recorder.h"
#include "server/tissue/step/simulation.h"
#include "tests/support/files.h"

namespace trocar::recording {
namespace {

TEST(RecordOrder, FramesThatWaitWhileAListComesKeepTheirTime) {
  constexpr Frame kFrames = 2000;
  const trocar::testing::TemporaryFolder folder;
  const auto path = folder.file("order.mcap");
  step::Simulation simulation(*catalogue::make_liver(800));
  std::shared_ptr<const step::PublishedFrame> first;
  while (!first) {
    simulation.tick({}, {});
    first = simulation.pop_frame();
  }
  auto recorder = Recorder::create(path, simulation.organ(), simulation.layout());
  ASSERT_TRUE(recorder.ok()) << recorder.error().message;
  // The writer wakes anywhere between a frame and the list that follows it.
  for (Frame i = 1; i <= kFrames; ++i) {
    auto frame = std::make_shared<step::PublishedFrame>(*first);
    frame->frame = i;
    frame->tick = i * kTicksPerFrame;
    (*recorder)->record_frame(frame);
    if (i % 2 == 0) (*recorder)->record_participants({}, frame->tick);
    while (i % 32 == 0 && (*recorder)->queued_bytes() > 0) std::this_thread::yield();
  }
  ASSERT_TRUE((*recorder)->close().ok());

  auto session = journal::SessionJournal::open(path);
  ASSERT_TRUE(session.ok()) << session.error().message;
  std::size_t seen = 0;
  const auto keeps_time = [&](Tick tick, const proto::SurfaceFrame& frame) {
    ++seen;
    EXPECT_EQ(tick, frame.tick());
    return true;
  };
  const Tick last = kFrames * kTicksPerFrame;
  EXPECT_TRUE((*session)->read_surface_deltas(0, last, keeps_time).ok());
  EXPECT_TRUE((*session)->read_surface_keys(0, last, keeps_time).ok());
  EXPECT_GE(seen, kFrames);
  Tick before = 0;
  const auto ascends = [&](Tick tick, const proto::Participants&) {
    EXPECT_GE(tick, before);
    before = tick;
    return true;
  };
  EXPECT_TRUE((*session)->read_participants(0, last, ascends).ok());
}

}  // namespace
}  // namespace trocar::recording
