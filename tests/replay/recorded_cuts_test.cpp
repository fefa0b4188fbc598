// Plays and verifies what the server's recorder writes of a surface that is cut.

#include <gtest/gtest.h>

#include <random>

#include "common/wire/surface_codec.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/session/recording/recorder.h"
#include "server/session/recording/verify.h"
#include "server/tissue/world/surface_layout.h"
#include "tests/replay/recorded_session.h"
#include "tests/support/surface_edits.h"

namespace trocar::replay::testing {
namespace {

using trocar::testing::Random;

class RecordedCuts : public ::testing::Test {
 protected:
  // `frames` frames, the surface cut in every third; those in `dropped` are too large for the
  // queue.
  void record(Frame frames, const std::vector<Frame>& dropped = {}) {
    const organ::Organ organ = *catalogue::make_lattice({6, 4, 6, 0.01});
    wire::SurfaceLayout layout = world::make_surface_layout(organ);
    auto recorder = recording::Recorder::create(path_, organ, layout);
    ASSERT_TRUE(recorder.ok());
    wire::QuantisedSurface surface(layout.vertex_count());
    Random random(1);
    for (Frame f = 1; f <= frames; ++f) {
      auto frame = std::make_shared<step::PublishedFrame>();
      if (f % 3 == 0) {
        frame->change =
            std::make_shared<wire::SurfaceChange>(trocar::testing::random_change(layout, random));
        ASSERT_TRUE(wire::apply(*frame->change, layout).ok());
        surface.resize(layout.vertex_count(), {300, -200, 100});
      }
      for (int i = 0; i < 40; ++i)
        surface[random.below(static_cast<std::uint32_t>(surface.size()))].y +=
            static_cast<std::int32_t>(random.below(60)) - 30;
      frame->frame = f;
      frame->tick = f * kTicksPerFrame;
      frame->epoch = layout.epoch;
      frame->surface = surface;
      frame->surface_crc = wire::surface_crc(surface);
      frame->regions.resize(surface.size());
      if (std::ranges::find(dropped, f) != dropped.end()) {
        frame->snapshot = std::make_shared<Bytes>(recording::Recorder::kQueueBytes + 1);
        frame->snapshot_tick = frame->tick;
      }
      (*recorder)->record_frame(frame);
      truth_.push_back({frame->surface_crc, layout.epoch, layout.triangle_sum});
    }
    ASSERT_TRUE((*recorder)->close().ok());
    ASSERT_EQ((*recorder)->counters().frames_dropped, dropped.size());
  }
  void expect_truth(const Player& player) {
    const replica::Replica& replica = player.replica;
    ASSERT_TRUE(replica.fault().ok()) << replica.fault().error().message;
    const auto& expected = truth_[replica.newest()->frame];
    ASSERT_EQ(wire::surface_crc(replica.newest()->surface), expected.crc);
    ASSERT_EQ(replica.topology().epoch, expected.epoch);
    std::uint64_t sum = 0;
    const auto& triangles = replica.topology().triangles;
    for (std::size_t i = 0; i < triangles.size(); ++i) {
      const auto [a, b, c] = triangles[i];
      if (a == b) continue;
      sum += wire::triangle_hash(TriangleIndex(i), {VertexIndex(a), VertexIndex(b), VertexIndex(c)},
                                 replica.topology().is_wound[i] != 0);
    }
    ASSERT_EQ(sum, expected.sum);
  }

  struct Expected {
    std::uint32_t crc = 0, epoch = 0;
    std::uint64_t sum = 0;
  };
  std::vector<Expected> truth_{1};  // by frame
  TemporaryFolder folder_;
  std::string path_ = folder_.file("cuts.mcap");
};

TEST_F(RecordedCuts, PlayFrameByFrameAndAfterAnySeek) {
  ASSERT_NO_FATAL_FAILURE(record(200));
  Player player(path_);
  for (Frame frame = 1; frame <= 200; ++frame) {
    player.step(frame == 1 ? 0 : 16);
    ASSERT_EQ(player.replica.newest()->frame, frame);
    ASSERT_NO_FATAL_FAILURE(expect_truth(player)) << frame;
  }
  EXPECT_EQ(player.replica.counters().keyframes, 1u);
  std::mt19937 random(3);
  for (int i = 0; i < 100; ++i) {
    const Frame frame = 1 + static_cast<Frame>(random() % 200);
    player.source->seek(frame * kTicksPerFrame);
    player.step(0);
    ASSERT_EQ(player.replica.newest()->frame, frame);
    ASSERT_NO_FATAL_FAILURE(expect_truth(player)) << frame;
  }
  const auto verified = recording::verify_journal(path_, {});
  ASSERT_TRUE(verified.ok());
  // These frames were never simulated: the surface stream is all that can be checked.
  EXPECT_EQ(verified->verdict(), recording::Verdict::NotVerified) << verified->why();
  EXPECT_EQ(verified->surfaces_decoded, 199u + 4u) << "keyframes too";
}

TEST_F(RecordedCuts, GoOnAfterDroppedFramesThatHadChanges) {
  ASSERT_NO_FATAL_FAILURE(record(200, {90, 91, 92, 93}));
  Player player(path_);
  for (Frame frame = 1; frame <= 200; ++frame) {
    player.step(frame == 1 ? 0 : 16);
    const bool is_missing = frame >= 90 && frame <= 93;
    ASSERT_EQ(player.replica.newest()->frame, is_missing ? 89 : frame);
    ASSERT_NO_FATAL_FAILURE(expect_truth(player)) << frame;
  }
  const auto verified = recording::verify_journal(path_, {});
  ASSERT_TRUE(verified.ok());
  EXPECT_EQ(verified->verdict(), recording::Verdict::NotVerified) << verified->why();
  // Keyframes come with frames 1 and 63, after the gap with 94, and a second later with 157. Frames
  // 1 and 94 have no delta, and four were dropped.
  EXPECT_EQ(verified->surfaces_decoded, 194u + 4u);
}

}  // namespace
}  // namespace trocar::replay::testing
