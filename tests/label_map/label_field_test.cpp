#include "server/organs/label_map/label_field.h"

#include <gtest/gtest.h>

#include <functional>

#include "server/organs/label_map/label_fit.h"
#include "server/organs/mesh/stuffing.h"

namespace trocar::label_map {
namespace {

constexpr double kWide_m = 0.001, kThick_m = 0.004;

// Voxels of 1 x 1 x 4 mm, the first at the origin; the outermost four along each axis are empty.
LabelMap block(const std::function<int(int, int, int)>& label) {
  LabelMap map;
  map.size = {28, 28, 28};
  map.labels.resize(28 * 28 * 28);
  for (int k = 4; k < 24; ++k)
    for (int j = 4; j < 24; ++j)
      for (int i = 4; i < 24; ++i)
        map.labels[map.index(i, j, k)] = static_cast<std::uint16_t>(label(i, j, k));
  EXPECT_TRUE(
      set_place({}, {Vec3d{kWide_m, 0, 0}, Vec3d{0, kWide_m, 0}, Vec3d{0, 0, kThick_m}}, map).ok());
  return map;
}

LabelSolid solid_of(const LabelMap& map) {
  auto solid = LabelSolid::make(map, {}, "a.nii");
  EXPECT_TRUE(solid.ok());
  return std::move(*solid);
}

Vec3d at(double i, double j, double k) {
  return {i * kWide_m, j * kWide_m, k * kThick_m};
}

TEST(LabelField, APlaneBetweenVoxelsStaysWhereItIs) {
  const auto solid = solid_of(block([](int, int, int k) { return k < 12 ? 1 : 2; }));
  const LabelField field(solid);
  for (const double place : {6.0, 12.3, 20.0}) {
    EXPECT_EQ(field(at(place, 13, 11.5 - 0.01)), 1);
    EXPECT_EQ(field(at(place, 13, 11.5 + 0.01)), 2);
  }
}

TEST(LabelField, ATubeOneVoxelThickStays) {
  const auto solid = solid_of(block([](int i, int j, int) { return i == 9 && j == 15 ? 3 : 1; }));
  const LabelField field(solid);
  for (double k = 5; k < 23; k += 0.25) EXPECT_EQ(field(at(9, 15, k)), 3) << k;
  EXPECT_EQ(field(at(10, 15, 8)), 1);
}

TEST(LabelField, InterfacesGoOnBesideTheSolid) {
  const auto solid = solid_of(block([](int i, int, int) { return i < 14 ? 1 : 2; }));
  const LabelField field(solid);
  for (const double j : {-3.0, 1.0, 26.0, 40.0}) {
    EXPECT_EQ(field(at(13.4, j, 10)), 1) << j;
    EXPECT_EQ(field(at(13.6, j, 10)), 2) << j;
  }
}

TEST(LabelFit, CountsVoxelsPiecesAndThickness) {
  // Two rods of 4 x 4 voxels, 80 mm long, in a block.
  const auto rod = [](int i, int j) { return j >= 10 && j < 14 && (i / 4 == 2 || i / 4 == 4); };
  const auto solid = solid_of(block([&](int i, int j, int) { return rod(i, j) ? 2 : 1; }));
  const auto mesh =
      mesh::stuff_isosurface([&](const Vec3d& p) { return solid.distance(p); }, solid.box(), 0.004);
  ASSERT_TRUE(mesh.ok());
  std::vector<std::uint16_t> labels(mesh->tets.size(), 1);
  auto fits = fit_of_labels(solid, *mesh, labels);
  ASSERT_EQ(fits.size(), 2u);
  EXPECT_EQ(fits[1].label, 2);
  EXPECT_EQ(fits[1].kept, 0);
  EXPECT_EQ(fits[1].mesh_pieces, 0u);
  EXPECT_EQ(fits[1].map_pieces, 2u);
  EXPECT_NEAR(fits[1].map_m3, 2 * 20 * 16 * 4e-9, 1e-12);
  // Four times volume over surface, whose steps count less.
  EXPECT_NEAR(fits[1].thickness_m, 1.5 * 0.004, 0.0006);
  EXPECT_EQ(fits[0].map_pieces, 1u);
  EXPECT_NEAR(fits[0].mesh_m3, mesh::total_volume(*mesh), 1e-12);
  EXPECT_GT(fits[0].kept, 0.9);  // edges and corners of the block are rounded off
  EXPECT_LE(fits[0].kept, 1);
  // The rods themselves, by where tets have their centre.
  for (std::size_t t = 0; t < labels.size(); ++t) {
    Vec3d centre;
    for (const NodeIndex node : mesh->tets[t]) centre += mesh->rest_positions[node.value] * 0.25;
    labels[t] = solid.label_at(centre) == 2 ? 2 : 1;
  }
  fits = fit_of_labels(solid, *mesh, labels);
  EXPECT_GT(fits[1].kept, 0.3);
  EXPECT_GE(fits[1].mesh_pieces, 2u);
}

}  // namespace
}  // namespace trocar::label_map
