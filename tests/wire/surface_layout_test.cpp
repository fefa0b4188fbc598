#include "common/wire/surface_layout.h"
#include "server/tissue/world/surface_layout.h"

#include <gtest/gtest.h>

namespace trocar::wire {
namespace {

// Five nodes, of which node 2 is interior; a closed surface over the other four.
organ::Organ small_organ() {
  organ::Organ organ;
  auto& mesh = organ.mesh;
  mesh.rest_positions = {
      {0.016, 0, 0}, {0, 0, 0.016}, {0.002, 0.002, 0.002}, {0, 0, 0}, {0, 0.016, 0}};
  mesh.surface_nodes = {NodeIndex(0), NodeIndex(1), NodeIndex(3), NodeIndex(4)};
  mesh.is_surface_node = {1, 1, 0, 1, 1};
  const auto triangle = [](int a, int b, int c) {
    return mesh::Triangle{NodeIndex(a), NodeIndex(b), NodeIndex(c)};
  };
  mesh.boundary_triangles = {triangle(3, 4, 0), triangle(3, 0, 1), triangle(3, 1, 4),
                             triangle(0, 4, 1)};
  organ.fixed_nodes = {NodeIndex(1), NodeIndex(2), NodeIndex(3)};
  return organ;
}

TEST(surface_layout, slots_follow_the_morton_curve) {
  const SurfaceLayout layout = world::make_surface_layout(small_organ());
  // The order is that of the Morton curve: the origin, then the nodes on x, y and z.
  EXPECT_EQ(layout.node_of_vertex,
            (std::vector{NodeIndex(3), NodeIndex(0), NodeIndex(4), NodeIndex(1)}));
  EXPECT_EQ(layout.vertex_of_node, (std::vector{VertexIndex(1), VertexIndex(3), VertexIndex(),
                                                VertexIndex(0), VertexIndex(2)}));
  EXPECT_EQ(layout.rest_quanta[1], (QuantisedVertex{500, 0, 0}));
}

TEST(surface_layout, triangles_keep_order_and_orientation) {
  const SurfaceLayout layout = world::make_surface_layout(small_organ());
  const std::array<VertexIndex, 3> first{VertexIndex(0), VertexIndex(2), VertexIndex(1)};
  const std::array<VertexIndex, 3> last{VertexIndex(1), VertexIndex(2), VertexIndex(3)};
  ASSERT_EQ(layout.triangles.size(), 4u);
  EXPECT_EQ(layout.triangles.front(), first);
  EXPECT_EQ(layout.triangles.back(), last);
}

TEST(surface_layout, fixed_vertices_are_surface_slots_ascending) {
  const SurfaceLayout layout = world::make_surface_layout(small_organ());
  EXPECT_EQ(layout.fixed_vertices, (std::vector{VertexIndex(0), VertexIndex(3)}));
}

}  // namespace
}  // namespace trocar::wire
