// The surface that is kept from edit to edit, against that of all tets anew.

#include "server/tissue/topology/surface_mesh.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "tests/cutting/cut_organ.h"

namespace trocar::cutting::testing {
namespace {

using Key = std::array<NodeIndex, 3>;

// Turned so that the lowest node is first: the same orientation gives the same key.
Key turned(const std::array<NodeIndex, 3>& nodes) {
  Key key = nodes;
  std::rotate(key.begin(), std::ranges::min_element(key), key.end());
  return key;
}

std::set<Key> surface_of(const topology::Topology& topology) {
  constexpr int kFaces[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
  std::map<Key, std::pair<int, Key>> faces;
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t) {
    if (!topology.has_tet(TetIndex(t))) continue;
    const auto& tet = topology.tet(TetIndex(t));
    for (const auto& face : kFaces) {
      const Key nodes{tet[static_cast<std::size_t>(face[0])],
                      tet[static_cast<std::size_t>(face[1])],
                      tet[static_cast<std::size_t>(face[2])]};
      Key key = nodes;
      std::ranges::sort(key);
      auto& entry = faces[key];
      ++entry.first;
      entry.second = turned(nodes);
    }
  }
  std::set<Key> surface;
  for (const auto& [key, entry] : faces)
    if (entry.first == 1) surface.insert(entry.second);
  return surface;
}

TEST(SurfaceMesh, FollowsEveryEditAndKeepsItsNumbers) {
  trocar::testing::Random random(5);
  const auto organ = box_organ(6, 4, 6, 0.01);
  topology::Topology topology(organ);
  Cutter cutter(topology);
  topology::SurfaceMesh surface(organ);
  std::vector<Key> known;
  for (const auto& nodes : organ.mesh.boundary_triangles) known.push_back(turned(nodes));
  double opened = 0;
  int edits = 0;
  for (int stroke = 0; stroke < 8; ++stroke) {
    const auto place = [&] {
      return Vec3d{random.between(-0.04, 0.04), random.between(-0.03, 0.03),
                   random.between(-0.04, 0.04)};
    };
    const Vec3d a = place(), along = place() * 0.7, way = place() * 1.5;
    for (int step = 0; step <= 60; ++step) {
      const Vec3d tip = a + way * (step / 60.0 - 0.5);
      const std::array<Vec3d, 2> edge{tip - along, tip + along};
      if (step < 60)
        cutter.move(0, edge);
      else
        cutter.lift(0);
      CutOutput out;
      do {
        out.clear();
        cutter.cut({}, out);
        opened += out.opened_area_m2;
        if (out.events.events.empty()) continue;
        ++edits;
        const auto& edit = surface.update(topology);
        topology.clear_changes();
        for (const auto triangle : edit.removed) {
          ASSERT_TRUE(known[triangle.value][0].is_valid()) << "removed twice";
          known[triangle.value] = {};
        }
        for (const auto& added : edit.added) known.push_back(turned(added.nodes));
        ASSERT_EQ(known.size(), surface.triangle_count());
      } while (out.is_behind);
    }
    std::set<Key> kept;
    for (std::uint32_t t = 0; t < known.size(); ++t) {
      if (!known[t][0].is_valid()) continue;
      ASSERT_TRUE(kept.insert(known[t]).second) << "listed twice";
      ASSERT_EQ(turned(surface[TriangleIndex(t)]), known[t]);
    }
    ASSERT_EQ(kept, surface_of(topology)) << "stroke " << stroke;
  }
  EXPECT_GT(edits, 50);
  // Wound faces are those that were opened, on both sides.
  double wound = 0;
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t)
    for (std::uint8_t corner = 0; corner < 4; ++corner)
      if (topology.wound_faces(TetIndex(t)) >> corner & 1)
        wound += face_area(topology, {TetIndex(t), corner});
  EXPECT_NEAR(wound, 2 * opened, 1e-9 + 1e-6 * opened);
  EXPECT_GT(opened, 1e-4);
}

}  // namespace
}  // namespace trocar::cutting::testing
