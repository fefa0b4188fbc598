// A surface that is cut while it is shown: what the replica holds, how it heals, and that no vertex
// is seen to jump.

#include <gtest/gtest.h>

#include <algorithm>

#include "client/replica/drawn_lines.h"
#include "client/replica/interpolated_surface.h"
#include "client/replica/replica.h"
#include "common/base/timing.h"
#include "proto/wire.pb.h"
#include "tests/client/synthetic_source.h"
#include "tests/support/surface_edits.h"

namespace trocar::replica {
namespace {

class SurfaceChangeTest : public ::testing::Test {
 protected:
  void start() {
    source_.queue_start();
    advance(10);
  }
  void advance(int frames) {
    for (int i = 0; i < frames; ++i) {
      source_.queue_frame();
      source_.poll(replica_);
    }
  }
  void cut() { source_.queue_change(testing::random_change(source_.layout(), random_)); }
  void expect_in_step() {
    ASSERT_TRUE(replica_.fault().ok()) << replica_.fault().error().message;
    ASSERT_EQ(replica_.sync_state(), SyncState::InStep);
    ASSERT_EQ(replica_.newest()->frame, source_.frame());
    ASSERT_EQ(replica_.newest()->surface, source_.surface());
    expect_same_topology();
  }
  void expect_same_topology() {
    const Topology& shown = replica_.topology();
    const wire::SurfaceLayout& layout = source_.layout();
    ASSERT_EQ(shown.epoch, layout.epoch);
    ASSERT_EQ(shown.rest_positions.size(), layout.vertex_count());
    for (std::size_t i = 0; i < layout.vertex_count(); ++i)
      ASSERT_EQ(shown.rest_positions[i], wire::to_metres(layout.rest_quanta[i]));
    ASSERT_EQ(shown.is_wound, layout.is_wound);
    ASSERT_EQ(shown.triangles.size(), layout.triangles.size());
    for (std::size_t i = 0; i < layout.triangles.size(); ++i)
      for (std::size_t k = 0; k < 3; ++k)
        ASSERT_EQ(shown.triangles[i][k],
                  layout.has_triangle(TriangleIndex(i)) ? layout.triangles[i][k].value : 0u);
    for (const SessionFrame& frame : replica_.history())
      ASSERT_EQ(frame.surface.size(), layout.vertex_count());
  }
  int sent_requests() const {
    return static_cast<int>(std::ranges::count_if(
        source_.sent, [](const auto& m) { return m.has_keyframe_request(); }));
  }

  testing::SyntheticSource source_{testing::make_blob_layout(16, 24, 0.08)};
  testing::Random random_{5};
  Replica replica_{[this](const proto::Envelope& message) { return source_.send(message); }};
};

// Points go to the triangles that have their place, and leave none behind.
TEST_F(SurfaceChangeTest, DrawnLinesStayWhereTheyAreAcrossCuts) {
  start();
  proto::Envelope message;
  const auto& layout = source_.layout();
  for (std::size_t i = 0; i < layout.triangles.size(); i += 7) {
    auto& stroke = *message.mutable_drawing()->add_stroke();
    wire::QuantisedVertex centre{};
    for (const auto corner : layout.triangles[i]) centre += layout.rest_quanta[corner.value];
    for (const auto value : {centre.x, centre.y, centre.z}) stroke.add_rest_quanta(value / 3);
  }
  source_.queue(message);
  advance(1);
  DrawnLines lines;
  const auto rest = [&] { return std::span<const Vec3f>(replica_.topology().rest_positions); };
  lines.update(replica_, rest());
  for (int i = 0; i < 40; ++i) {
    cut();
    advance(1);
    ASSERT_NO_FATAL_FAILURE(expect_in_step());
    lines.update(replica_, rest());
    ASSERT_EQ(lines.lines().size(), replica_.told().strokes().size());
    for (std::size_t k = 0; k < lines.lines().size(); ++k) {
      const auto& point = lines.lines()[k].points[0];
      if (point.normal == Vec3f{}) continue;  // its tissue is gone
      ASSERT_LT(length(point.position - replica_.told().strokes()[k].rest_m[0]), 0.0041f);
    }
  }
}

TEST_F(SurfaceChangeTest, EveryFrameMayBeginAnEpoch) {
  start();
  const auto version = replica_.topology_version(), restarts = replica_.history_version();
  for (int i = 0; i < 60; ++i) {
    cut();
    advance(1);
    ASSERT_NO_FATAL_FAILURE(expect_in_step());
  }
  EXPECT_EQ(replica_.counters().surface_changes, 60u);
  EXPECT_EQ(replica_.counters().keyframes, 1u);
  EXPECT_EQ(replica_.topology_version(), version + 60);
  EXPECT_EQ(replica_.history_version(), restarts);
  EXPECT_EQ(replica_.newest()->regions.size(), source_.surface().size());
}

TEST_F(SurfaceChangeTest, NothingIsShownBeforeItsFrame) {
  start();
  const Topology before = replica_.topology();
  const auto newest = replica_.newest()->surface;
  for (int i = 0; i < 5; ++i) cut();
  source_.poll(replica_);
  EXPECT_EQ(replica_.topology().triangles, before.triangles);
  EXPECT_EQ(replica_.newest()->surface, newest);
  advance(1);  // one delta over five epochs
  expect_in_step();
  EXPECT_EQ(replica_.counters().keyframes, 1u);
}

TEST_F(SurfaceChangeTest, WhatDoesNotFollowHealsWithOneRequest) {
  const auto damage = [](proto::SurfaceChange& change, int kind) {
    if (kind == 0) return false;  // lost
    if (kind == 1) change.set_triangle_sum(change.triangle_sum() ^ 1);
    if (kind == 2) change.set_removed(0, 1'000'000);
    if (kind == 3) change.add_corner(1);
    if (kind == 4) change.set_from_epoch(change.from_epoch() + 7);
    if (kind == 5) change.set_origin(0, 0xffffffffu);
    return true;
  };
  start();
  for (int kind = 0; kind < 6; ++kind) {
    source_.answer_requests = false;
    const int requests = sent_requests();
    const auto shown = replica_.newest()->surface;
    const auto topology = replica_.topology();
    const auto healed = replica_.counters().healed;
    source_.tamper = [&](proto::Envelope& m) {
      return !m.has_surface_change() || damage(*m.mutable_surface_change(), kind);
    };
    cut();
    advance(1);
    source_.tamper = nullptr;
    cut();
    advance(8);
    // The last good picture stays, whatever comes until then.
    ASSERT_EQ(replica_.sync_state(), SyncState::Healing) << kind;
    ASSERT_EQ(replica_.newest()->surface, shown);
    ASSERT_EQ(replica_.topology().triangles, topology.triangles);
    ASSERT_EQ(sent_requests(), requests + 1);
    source_.queue_topology();
    source_.poll(replica_);
    ASSERT_EQ(replica_.newest()->surface, shown) << "the topology waits for its keyframe";
    advance(1);
    ASSERT_NO_FATAL_FAILURE(expect_in_step()) << kind;
    ASSERT_EQ(replica_.counters().healed, healed + 1);
    cut();
    advance(5);
    ASSERT_NO_FATAL_FAILURE(expect_in_step());
  }
  EXPECT_EQ(replica_.counters().change_mismatches, 5u);
}

TEST_F(SurfaceChangeTest, AKeyframeWithoutItsTopologyIsNotShown) {
  start();
  source_.tamper = [](proto::Envelope& m) { return !m.has_surface_change(); };
  cut();
  source_.queue_frame(true);
  source_.poll(replica_);
  EXPECT_EQ(replica_.sync_state(), SyncState::Healing);
  EXPECT_TRUE(replica_.fault().ok());
  EXPECT_LT(replica_.newest()->frame, source_.frame());
  advance(1);  // answered with topology and keyframe
  expect_in_step();
}

// Whatever the display shows, a new vertex is at most a frame's motion away from where its parents
// are at that moment, and what has none keeps to the displacements around it: never at rest, never
// at zero.
TEST_F(SurfaceChangeTest, NoVertexJumpsWhenItIsNew) {
  start();
  advance(60);  // well deformed
  InterpolatedSurface shown;
  std::uint64_t now = monotonic_ns();
  shown.update(replica_, now);
  for (int i = 0; i < 40; ++i) {
    const std::size_t first = source_.layout().vertex_count();
    const auto change = testing::random_change(source_.layout(), random_);
    source_.queue_change(change);
    advance(1);
    for (int k = 0; k < 6; ++k) {
      shown.update(replica_, now += 3'000'000);
      const auto& positions = shown.positions();
      ASSERT_EQ(positions.size(), source_.layout().vertex_count());
      for (std::size_t n = 0; n < change.new_vertices.size(); ++n) {
        const wire::NewVertex& v = change.new_vertices[n];
        const auto& rest = replica_.topology().rest_positions;
        const Vec3f moved = positions[first + n] - rest[first + n];
        if (v.has_parents()) {
          const float t = static_cast<float>(v.t) / 65536;
          const Vec3f expected =
              positions[v.a.value] + (positions[v.b.value] - positions[v.a.value]) * t;
          ASSERT_LT(length(positions[first + n] - expected), 2.5e-3f) << "change " << i;
        } else {
          const Vec3f truth = wire::to_metres(replica_.newest()->surface[first + n]);
          ASSERT_LT(length(moved - truth), 1.5e-3f) << "change " << i;
        }
      }
    }
  }
}

}  // namespace
}  // namespace trocar::replica
