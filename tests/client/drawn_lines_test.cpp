// Lines on the organ: where they are attached, how they move, and what a cut does to them.

#include "client/replica/drawn_lines.h"

#include <gtest/gtest.h>

#include <limits>

#include "client/shape/ribbon.h"
#include "proto/wire.pb.h"
#include "tests/client/square.h"

namespace trocar::replica {
namespace {

TEST(DrawnLines, APlaceIsAttachedToTheNearestTriangle) {
  const auto topology = square();
  for (const Vec3f place : {Vec3f{0.008f, 0.002f, 0}, Vec3f{0.002f, 0.008f, 0.001f},
                            Vec3f{0.02f, 0.005f, 0}, Vec3f{-0.01f, -0.01f, 0}}) {
    const auto found = attach(place, topology, topology.rest_positions);
    ASSERT_LT(found.triangle, 2u);
    const auto& corners = topology.triangles[found.triangle];
    const auto at = [&](std::size_t i) { return topology.rest_positions[corners[i]]; };
    const Vec3f nearest =
        at(0) + (at(1) - at(0)) * found.weight[0] + (at(2) - at(0)) * found.weight[1];
    const Vec3f expected{std::clamp(place.x, 0.0f, 0.01f), std::clamp(place.y, 0.0f, 0.01f), 0};
    EXPECT_LT(length(nearest - expected), 1e-6f);
    EXPECT_NEAR(found.distance_m, length(place - expected), 1e-6f);
  }
}

TEST(DrawnLines, WoundsAndGapsTakeNoPoint) {
  auto topology = square();
  topology.is_wound[0] = 1;
  EXPECT_EQ(attach({0.008f, 0.002f, 0}, topology, topology.rest_positions).triangle, 1u);
  topology.triangles[1] = {};
  EXPECT_EQ(attach({0.008f, 0.002f, 0}, topology, topology.rest_positions).triangle, kNoTriangle);
}

proto::Envelope drawing(bool is_addition, std::vector<std::int32_t> quanta) {
  proto::Envelope envelope;
  envelope.mutable_drawing()->set_is_addition(is_addition);
  auto& stroke = *envelope.mutable_drawing()->add_stroke();
  stroke.set_participant(16);
  for (const auto value : quanta) stroke.add_rest_quanta(value);
  return envelope;
}

TEST(DrawnLines, TheReplicaKeepsWhatIsDrawn) {
  Replica replica([](const proto::Envelope&) { return true; });
  replica.on_message(drawing(true, {100, 0, 0, 10, -5, 0}), 0, 0);
  replica.on_message(drawing(true, {1, 2, 3}), 0, 0);
  ASSERT_EQ(replica.told().strokes().size(), 2u);
  EXPECT_FLOAT_EQ(replica.told().strokes()[0].rest_m[1].x, 110 * 32e-6f);
  EXPECT_FLOAT_EQ(replica.told().strokes()[0].rest_m[1].y, -5 * 32e-6f);
  const auto version = replica.told().drawing_version();
  replica.on_message(drawing(false, {7, 8, 9}), 0, 0);
  EXPECT_EQ(replica.told().strokes().size(), 1u);
  EXPECT_NE(replica.told().drawing_version(), version);
  EXPECT_TRUE(replica.fault().ok());
}

TEST(DrawnLines, WhatIsNoDrawingIsRefused) {
  const auto most = std::numeric_limits<std::int32_t>::max();
  for (const auto& quanta : std::vector<std::vector<std::int32_t>>{
           {1, 2}, {most, 0, 0}, {60'000, 0, 0, 60'000, 0, 0}, std::vector<std::int32_t>(30'000)}) {
    Replica replica([](const proto::Envelope&) { return true; });
    replica.on_message(drawing(true, quanta), 0, 0);
    EXPECT_FALSE(replica.fault().ok());
  }
}

TEST(Ribbon, JoinsNeighboursAndLeavesGaps) {
  const Vec3f up{0, 0, 1};
  const std::vector<shape::RibbonPoint> points{{{0, 0, 0}, up},
                                               {{0.005f, 0, 0}, up},
                                               {{0.01f, 0, 0}, up},
                                               {{0.1f, 0, 0}, up},
                                               {{0, 0, 0}, {}}};
  shape::MeshVertices mesh;
  shape::add_ribbon(points, 0.001f, {1, 2, 3}, mesh);
  EXPECT_EQ(mesh.size(), 2 * 3 * 6u) << "two bands, a dot beyond the gap, and their dark border";
  for (const auto& vertex : mesh) {
    const bool is_line = vertex.material[0] == 1;
    EXPECT_GT(vertex.position.z, 0) << "above the surface";
    EXPECT_LE(std::abs(vertex.position.y), is_line ? 0.0016f : 0.0027f);
    for (const auto& other : mesh)
      if (is_line && other.material[0] != 1) {
        EXPECT_GT(vertex.position.z, other.position.z) << "the border lies below";
      }
  }
}

}  // namespace
}  // namespace trocar::replica
