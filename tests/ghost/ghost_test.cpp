// The full solution beside a session with a reduction: frames of a real simulation loop.

#include "server/session/ghost/ghost.h"

#include <gtest/gtest.h>

#include <cmath>
#include <condition_variable>
#include <mutex>

#include "server/app/server/simulation_loop.h"
#include "server/tissue/reduction/reduced_tissue.h"
#include "tests/reduce/reduced_block.h"

namespace trocar::ghost {
namespace {

const reduce::testing::ReducedBlock& made() {
  static const reduce::testing::ReducedBlock instance(6);
  return instance;
}

// A tool presses and slides on the first patch; from 0.6 s on a blade cuts far from it, if it is
// to.
class Session {
 public:
  explicit Session(bool is_cut = false) : is_cut_(is_cut) {
    for (std::uint8_t hand = 0; hand < 2; ++hand) {
      hands::HandJoin join{.slot = {hand}};
      if (hand == 0)
        join.shapes[0] = {.radius_m = 0.012f, .length_m = 0.3f, .reach_m = 0.012f};
      else
        join.shapes[0] = {.radius_m = 0.002f, .length_m = 0.3f, .edge_m = 0.03f};
      EXPECT_TRUE(inbox_.try_push_join(join));
    }
  }

  step::SharedFrame next_frame() {
    frames_.clear();
    while (frames_.empty()) {
      push_samples();
      loop_.run_tick();
      handover_.pop_all(frames_);
    }
    return frames_.front();
  }
  step::Simulation& simulation() { return simulation_; }
  app::SimulationLoop& loop() { return loop_; }

 private:
  void push_samples() {
    const float t = static_cast<float>(simulation_.current_tick()) * 1e-3f;
    const Vec3f at = to_float(made().centre(made().near_top(0)));
    const float height = 0.003f - std::min(0.008f, 0.05f * t);
    inbox_.push_sample({tool_slot({0}, 0),
                        {{{at.x, at.y + height, at.z + 0.004f * t}, rotation_from_z({0, 1, 0})},
                         tool::Verb::Push}});
    const float since = is_cut_ ? t - 0.6f : -1;
    const float depth = since < 0 ? -0.05f : since < 0.4f ? 0.01f : -0.03f;
    const float x = -0.04f + 0.1f * std::clamp(since, 0.0f, 0.4f);
    inbox_.push_sample(
        {tool_slot({1}, 0),
         {{{x, 0.03f - depth, at.z > 0 ? -0.05f : 0.05f}, rotation_from_z({0, 1, 0})},
          since > 0 && since < 0.4f ? tool::Verb::Cut : tool::Verb::None}});
  }

  const bool is_cut_;
  step::Simulation simulation_{made().organ, 1, reduction::at_work(made().local)};
  participants::SimulationInbox inbox_;
  app::FrameHandover handover_{[] {}};
  app::SimulationLoop loop_{simulation_, inbox_, handover_, nullptr, {}, [] {}};
  std::vector<step::SharedFrame> frames_;
};

TEST(GhostFollower, IsTheFullSolutionToTheBit) {
  Session session;
  GhostFollower follower(session.simulation(), {});
  step::Simulation full(made().organ);  // which knows of no reduction
  EXPECT_TRUE(follower.wants_snapshot());
  std::size_t reduced = 0;
  float largest_m = 0;
  for (int i = 0; i < 60; ++i) {
    const auto frame = session.next_frame();
    reduced += frame->figures.solve.is_reduced() ? 1u : 0u;
    follower.repeat(*frame);
    ASSERT_EQ(follower.status(), GhostStatus::Follows) << i;
    for (const auto& record : frame->records) full.tick(record.inputs, {});
    const auto own = full.pop_frame();
    ASSERT_EQ(follower.simulation().state().world.displacements, full.state().world.displacements)
        << i;
    const auto report = follower.compare(*frame);
    EXPECT_EQ(report.frame, frame->frame);
    ASSERT_EQ(report.offsets.size(), own->surface.size());
    float farthest = 0;
    for (std::size_t v = 0; v < own->surface.size(); ++v) {
      ASSERT_EQ(frame->surface[v] + report.offsets[v], own->surface[v]);
      farthest = std::max(farthest, length(wire::to_metres(report.offsets[v])));
    }
    EXPECT_FLOAT_EQ(report.largest_m, farthest);
    EXPECT_LE(report.root_mean_square_m, farthest);
    largest_m = std::max(largest_m, farthest);
  }
  EXPECT_GT(reduced, 30u);
  EXPECT_GT(largest_m, 0);
  EXPECT_LT(largest_m, 5e-4f);  // of 5 mm
}

TEST(GhostFollower, BeginsFromASnapshotThatIsAskedFor) {
  Session session;
  for (int i = 0; i < 20; ++i) session.next_frame();
  GhostFollower follower(session.simulation(), {});
  for (int i = 0; i < 5; ++i) follower.repeat(*session.next_frame());
  EXPECT_EQ(follower.status(), GhostStatus::Begins);
  session.loop().request_snapshot();
  for (int i = 0; i < 3; ++i) follower.repeat(*session.next_frame());
  ASSERT_EQ(follower.status(), GhostStatus::Follows);
  // A frame that did not arrive.
  session.next_frame();
  follower.repeat(*session.next_frame());
  EXPECT_EQ(follower.status(), GhostStatus::Behind);
  EXPECT_TRUE(follower.wants_snapshot());
  session.loop().request_snapshot();
  for (int i = 0; i < 3; ++i) follower.repeat(*session.next_frame());
  EXPECT_EQ(follower.status(), GhostStatus::Follows);
}

TEST(GhostFollower, BeginsAgainAfterACut) {
  Session session(true);
  GhostFollower follower(session.simulation(), {});
  std::size_t changes = 0, begun = 0;
  for (int i = 0; i < 110; ++i) {
    const auto before = follower.status();
    const auto frame = session.next_frame();
    follower.repeat(*frame);
    if (frame->change) {
      ++changes;
      EXPECT_EQ(follower.status(), GhostStatus::Changed);
      EXPECT_FALSE(follower.wants_snapshot());
    }
    if (follower.wants_snapshot()) session.loop().request_snapshot();
    if (follower.status() != GhostStatus::Follows) continue;
    if (before != GhostStatus::Follows) ++begun;
    EXPECT_EQ(follower.compare(*frame).offsets.size(), frame->surface.size());
    EXPECT_EQ(follower.compare(*frame).epoch, frame->epoch);
  }
  EXPECT_GT(changes, 2u);
  EXPECT_GE(begun, 2u);
  EXPECT_EQ(follower.status(), GhostStatus::Follows);
}

// Reports of a ghost's thread.
class Reports {
 public:
  GhostOptions options(Session& session) {
    return {{},
            [&session] { session.loop().request_snapshot(); },
            [this](std::shared_ptr<const GhostReport> report) {
              const std::lock_guard lock(mutex_);
              reports_.push_back(std::move(report));
              wake_.notify_all();
            }};
  }
  // Waits for the next one that follows; null after 20 s.
  std::shared_ptr<const GhostReport> next() {
    std::unique_lock lock(mutex_);
    for (;;) {
      while (taken_ < reports_.size())
        if (auto report = reports_[taken_++]; report->status == GhostStatus::Follows) return report;
      if (wake_.wait_for(lock, std::chrono::seconds(20)) == std::cv_status::timeout) return nullptr;
    }
  }

 private:
  std::mutex mutex_;
  std::condition_variable wake_;
  std::vector<std::shared_ptr<const GhostReport>> reports_;
  std::size_t taken_ = 0;
};

TEST(Ghost, ReportsWhileSomebodyWantsIt) {
  Session session;
  Reports reports;
  Ghost ghost(session.simulation(), reports.options(session));
  const auto give = [&](int frames) {
    for (int i = 0; i < frames; ++i) {
      const auto frame = session.next_frame();
      ghost.push({&frame, 1});
    }
  };
  give(4);  // nobody wants it
  ghost.set_wanted(true);
  // Frames come as in real time until the ghost has its snapshot and computes a frame.
  std::shared_ptr<const GhostReport> report;
  for (int i = 0; i < 200 && ghost.counters().frames == 0; ++i) {
    give(1);
    std::this_thread::sleep_for(std::chrono::milliseconds(16));
  }
  report = reports.next();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->frame % kFramesPerReport, 0u);
  EXPECT_GT(report->frame, 4u);
  ghost.set_wanted(false);
  const auto counters = ghost.counters();
  EXPECT_GE(counters.frames, 1u);
  EXPECT_EQ(counters.begun, 1u);
  EXPECT_EQ(counters.fallen, 0u);
  give(kFramesPerReport);
  ghost.set_wanted(true);
  ghost.set_wanted(false);
  EXPECT_LE(ghost.counters().frames, counters.frames + 1);
}

TEST(Ghost, ThatIsGivenMoreThanItTakesBeginsAgain) {
  Session session;
  Reports reports;
  Ghost ghost(session.simulation(), reports.options(session));
  ghost.set_wanted(true);
  std::vector<step::SharedFrame> frames;
  for (std::size_t i = 0; i < 60; ++i) frames.push_back(session.next_frame());
  // The same again and again: only their number counts.
  for (int i = 0; i < 100; ++i) ghost.push(frames);
  for (int i = 0; i < 400 && ghost.counters().fallen == 0; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_GE(ghost.counters().fallen, 1u);
}

}  // namespace
}  // namespace trocar::ghost
