#include "server/organs/formats/mesh_writer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "common/base/json.h"
#include "server/organs/formats/glb_reader.h"
#include "server/organs/formats/mesh_file.h"
#include "server/organs/mesh/stuffing.h"
#include "server/organs/surface/closed_surface.h"

namespace trocar::formats {
namespace {

// A ball of 40 mm across, its upper half region 1, away from the origin in its source.
struct Ball {
  mesh::TetMesh mesh =
      *mesh::stuff_isosurface([](const Vec3d& p) { return length(p) - 0.02; },
                              {{-0.021, -0.021, -0.021}, {0.021, 0.021, 0.021}}, 0.008);
  Vec3d offset = centre_on_origin(mesh);
  WrittenMesh written{.mesh = mesh,
                      .name = "ball",
                      .offset_m = {0.1, -0.2, 1.0 / 3},
                      .unit = mesh::Unit::Millimetre,
                      .tet_regions = {},
                      .region_names = {"below", "above"},
                      .held_nodes = {NodeIndex(2), NodeIndex(5)}};

  Ball() {
    for (const auto& tet : mesh.tets) {
      const bool is_above = std::ranges::all_of(
          tet, [&](NodeIndex node) { return mesh.rest_positions[node.value].y > -1e-6; });
      written.tet_regions.push_back(is_above);
    }
  }
};

TEST(MeshWriter, TetsComeBackAsTheyWere) {
  const Ball ball;
  for (const auto& [name, text] :
       {std::pair("a.msh", to_gmsh(ball.written)), std::pair("a.vtu", to_vtu(ball.written))}) {
    SCOPED_TRACE(name);
    auto parsed = parse_mesh(text, name);
    ASSERT_TRUE(parsed.ok()) << parsed.error().message;
    const auto again =
        mesh::make_mesh(std::get<mesh::RawTets>(std::move(*parsed)), mesh::Unit::Millimetre, name);
    ASSERT_TRUE(again.ok()) << again.error().message;
    EXPECT_TRUE(again->warnings.empty());
    EXPECT_EQ(again->mesh.tets, ball.mesh.tets);
    EXPECT_NEAR(length(again->offset_m - ball.written.offset_m), 0, 1e-15);
    for (std::size_t i = 0; i < ball.mesh.node_count(); ++i)
      EXPECT_NEAR(length(again->mesh.rest_positions[i] - ball.mesh.rest_positions[i]), 0, 1e-15);
    EXPECT_EQ(again->regions.size(), 2u);
    if (std::string(name) != "a.msh") continue;
    EXPECT_EQ(again->regions[1].name, "above");
    ASSERT_EQ(again->node_sets.size(), 1u);
    EXPECT_EQ(again->node_sets[0].name, "held");
    EXPECT_EQ(again->node_sets[0].nodes, ball.written.held_nodes);
  }
}

TEST(MeshWriter, TheSurfaceComesBackClosed) {
  const Ball ball;
  auto parsed = parse_mesh(to_stl(ball.written), "a.stl");
  ASSERT_TRUE(parsed.ok()) << parsed.error().message;
  const auto solid = surface::check_surface(std::get<surface::RawSurface>(std::move(*parsed)),
                                            mesh::Unit::Millimetre, "a.stl");
  ASSERT_TRUE(solid.ok()) << solid.error().message;
  EXPECT_TRUE(solid->warnings.empty());
  EXPECT_EQ(solid->triangles.size(), ball.mesh.boundary_triangles.size());
  // The file has single precision: 24 bits of 333 mm.
  EXPECT_NEAR(solid->volume_m3, mesh::total_volume(ball.mesh), 1e-4 * solid->volume_m3);
}

TEST(MeshWriter, GlbSaysTrueLengths) {
  const Ball ball;
  const auto glb = to_glb(ball.written);
  const auto number = [&](std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, glb.data() + at, sizeof value);
    return value;
  };
  ASSERT_TRUE(glb.starts_with("glTF"));
  EXPECT_EQ(number(4), 2u);
  EXPECT_EQ(number(8), glb.size());
  const auto json = Json::parse(glb.substr(20, number(12)));
  const std::size_t body = 20 + number(12);
  EXPECT_EQ(number(12) % 4, 0u);
  EXPECT_EQ(number(body), glb.size() - body - 8);
  EXPECT_EQ(json["buffers"][0]["byteLength"], number(body));
  EXPECT_EQ(json["accessors"][0]["count"], ball.mesh.surface_nodes.size());
  EXPECT_EQ(json["accessors"][2]["count"], 3 * ball.mesh.boundary_triangles.size());
}

TEST(MeshWriter, GlbOfAPaintedSurfaceIsReadAgain) {
  GlbSurface surface{.name = "painted",
                     .positions = {{0, 0, 0}, {0.1f, 0, 0}, {0, 0.1f, 0}, {0.1f, 0.1f, 0.1f}},
                     .normals = {},
                     .texture = {{0, 0}, {1, 0}, {0, 0.25f}, {0.5f, 1}},
                     .triangles = {{0, 1, 2}, {1, 3, 2}},
                     .picture = std::string("\x89PNG\r\n\x1a\n", 8) + "odd"};
  const auto raw = parse_glb(to_glb(surface), "a.glb");
  ASSERT_TRUE(raw.ok()) << raw.error().message;
  EXPECT_EQ(raw->picture, surface.picture);
  ASSERT_EQ(raw->triangles.size(), 2u);
  ASSERT_EQ(raw->corner_texture.size(), 2u);
  for (std::size_t t = 0; t < 2; ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = surface.triangles[t][k];
      EXPECT_EQ(to_float(raw->positions[raw->triangles[t][k].value]), surface.positions[v]);
      const auto [across, upward] = raw->corner_texture[t][k];
      EXPECT_EQ(across, double{surface.texture[v][0]});
      EXPECT_EQ(upward, double{surface.texture[v][1]});
    }
}

TEST(MeshWriter, GlbIsReadAgain) {
  const Ball ball;
  const auto raw = parse_glb(to_glb(ball.written), "a.glb");
  ASSERT_TRUE(raw.ok()) << raw.error().message;
  ASSERT_EQ(raw->triangles.size(), ball.mesh.boundary_triangles.size());
  for (std::size_t t = 0; t < raw->triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3f there =
          to_float(ball.mesh.rest_positions[ball.mesh.boundary_triangles[t][k].value]);
      EXPECT_EQ(to_float(raw->positions[raw->triangles[t][k].value]), there);
    }
  EXPECT_TRUE(raw->corner_texture.empty());
}

}  // namespace
}  // namespace trocar::formats
