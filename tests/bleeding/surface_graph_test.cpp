// A graph that has followed every change is the one that is built from the surface at the end.

#include "server/tissue/bleeding/surface_graph.h"

#include <gtest/gtest.h>

#include "tests/bleeding/cut_liver.h"

namespace trocar::bleeding {
namespace {

TEST(SurfaceGraph, FollowedIsAsBuiltAnewToTheBit) {
  SurfaceGraph followed;
  std::uint64_t changes = 0;
  testing::cut_liver(11, 3000, [&](step::PublishedFrame& frame, step::Simulation& simulation) {
    const auto& layout = simulation.layout();
    if (frame.frame == 1) followed.rebuild(layout);
    if (frame.frame == 1 || !frame.change) return;
    ++changes;
    followed.apply(*frame.change, layout);
    SurfaceGraph built;
    built.rebuild(layout);
    ASSERT_EQ(followed.vertex_count(), built.vertex_count());
    for (std::uint32_t vertex = 0; vertex < built.vertex_count(); ++vertex) {
      ASSERT_EQ(followed.area_m2(vertex), built.area_m2(vertex));
      ASSERT_EQ(followed.wound_m2(vertex), built.wound_m2(vertex));
      std::vector<std::uint32_t> around[2];
      followed.each_triangle(vertex, [&](auto a, auto b) {
        around[0].insert(around[0].end(), {a, b});
      });
      built.each_triangle(vertex, [&](auto a, auto b) {
        around[1].insert(around[1].end(), {a, b});
      });
      ASSERT_EQ(around[0], around[1]);
    }
  });
  EXPECT_GT(changes, 20u);
}

TEST(SurfaceGraph, AreasOfVerticesAreTheSurface) {
  testing::cut_liver(12, 800, [&](step::PublishedFrame& frame, step::Simulation& simulation) {
    if (frame.frame != 50) return;
    const auto& layout = simulation.layout();
    SurfaceGraph graph;
    graph.rebuild(layout);
    double all = 0, wound = 0, triangles = 0, cut = 0;
    for (std::uint32_t vertex = 0; vertex < graph.vertex_count(); ++vertex) {
      all += graph.area_m2(vertex);
      wound += graph.wound_m2(vertex);
    }
    const auto rest = [&](VertexIndex v) {
      return to_double(wire::to_metres(layout.rest_quanta[v.value]));
    };
    for (std::size_t i = 0; i < layout.triangles.size(); ++i) {
      if (!layout.has_triangle(TriangleIndex(i))) continue;
      const auto& [a, b, c] = layout.triangles[i];
      const double area = length(cross(rest(b) - rest(a), rest(c) - rest(a))) / 2;
      triangles += area;
      cut += layout.is_wound[i] != 0 ? area : 0;
    }
    EXPECT_NEAR(all, triangles, 1e-9);
    EXPECT_NEAR(wound, cut, 1e-9);
    EXPECT_GT(cut, 0);
  });
}

}  // namespace
}  // namespace trocar::bleeding
