#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/base/bytes.h"
#include "common/base/checksum.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/liver_shape.h"
#include "server/organs/mesh/pieces.h"

namespace trocar::organ {
namespace {

Vec3d highest_corner(const mesh::TetMesh& mesh) {
  Vec3d high = mesh.rest_positions.front();
  for (const Vec3d& p : mesh.rest_positions)
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  return high;
}

// Sharpest angle of the solid at an edge of the surface within `box`, degrees.
double sharpest_edge(const mesh::TetMesh& mesh, const Vec3d& low, const Vec3d& high) {
  struct Side {
    mesh::NodePair edge;
    Vec3d normal;
  };
  std::vector<Side> sides;
  for (const auto& t : mesh.boundary_triangles) {
    const Vec3d& p = mesh.rest_positions[t[0].value];
    const Vec3d normal = normalized(
        cross(mesh.rest_positions[t[1].value] - p, mesh.rest_positions[t[2].value] - p), Vec3d{});
    for (int i = 0; i < 3; ++i) {
      const auto [a, b] = std::minmax(t[i], t[(i + 1) % 3]);
      sides.push_back({{a, b}, normal});
    }
  }
  std::stable_sort(sides.begin(), sides.end(),
                   [](const Side& a, const Side& b) { return a.edge < b.edge; });
  double largest_turn = 0;
  for (std::size_t i = 0; i + 1 < sides.size(); i += 2) {
    const Vec3d& p = mesh.rest_positions[sides[i].edge[0].value];
    const bool within =
        p.x > low.x && p.y > low.y && p.z > low.z && p.x < high.x && p.y < high.y && p.z < high.z;
    if (within)
      largest_turn =
          std::max(largest_turn,
                   std::acos(std::clamp(dot(sides[i].normal, sides[i + 1].normal), -1.0, 1.0)));
  }
  return 180 - largest_turn * 180 / 3.141592653589793;
}

TEST(Liver, DefaultHasTheStatedFigures) {
  const auto organ = catalogue::make_liver();
  ASSERT_TRUE(organ.ok()) << organ.error().message;
  const auto& mesh = organ->mesh;
  EXPECT_NEAR(static_cast<double>(mesh.node_count()), 4000, 100);
  EXPECT_NEAR(static_cast<double>(mesh.tets.size()), catalogue::kDefaultLiverTets,
              0.05 * catalogue::kDefaultLiverTets);
  const Vec3d size = highest_corner(mesh) * 2.0;
  EXPECT_NEAR(size.x, 0.241, 0.002);
  EXPECT_NEAR(size.y, 0.153, 0.002);
  EXPECT_NEAR(size.z, 0.137, 0.002);
  EXPECT_NEAR(mesh::total_volume(mesh), 1.617e-3, 0.005e-3);
  const double mass =
      std::accumulate(organ->node_masses_kg.begin(), organ->node_masses_kg.end(), 0.0);
  EXPECT_NEAR(mass, 1060 * mesh::total_volume(mesh), 1e-9);
  const auto angles = mesh::dihedral_range(mesh);
  EXPECT_GT(angles.min_deg, 16);
  EXPECT_LT(angles.max_deg, 150);
  EXPECT_EQ(mesh::find_pieces(mesh).count, 1u);
  const double fixed_share =
      static_cast<double>(organ->fixed_nodes.size()) / static_cast<double>(mesh.node_count());
  EXPECT_NEAR(fixed_share, 0.047, 0.005);
}

TEST(Liver, MeshIsTheSameOnEveryMachine) {
  const auto organ = catalogue::make_liver();
  ASSERT_TRUE(organ.ok());
  StateHasher hasher;
  hasher.update(bytes_of(organ->mesh.rest_positions));
  hasher.update(bytes_of(organ->mesh.tets));
  hasher.update(bytes_of(organ->fixed_nodes));
  EXPECT_EQ(hasher.digest(), 0xf08273e05ab07b04ull) << std::hex << hasher.digest();
}

TEST(Liver, MeetsTheNumberOfTetsFromSmallToLarge) {
  for (const int target : {500, 777, 1000, 1500, 3000, 6000, 12000, 40000, 200000}) {
    const auto organ = catalogue::make_liver(target);
    ASSERT_TRUE(organ.ok()) << organ.error().message;  // make_liver validates
    EXPECT_NEAR(static_cast<double>(organ->mesh.tets.size()), target, 0.05 * target);
    const double width = highest_corner(organ->mesh).x * 2;
    EXPECT_GT(width, 0.20);
    EXPECT_LT(width, 0.25);
    const double litres = mesh::total_volume(organ->mesh) * 1e3;
    EXPECT_GT(litres, 1.3);
    EXPECT_LT(litres, 1.8);
    const auto angles = mesh::dihedral_range(organ->mesh);
    EXPECT_GT(angles.min_deg, mesh::kStuffingMinDihedral_deg) << target;
    EXPECT_LT(angles.max_deg, mesh::kStuffingMaxDihedral_deg) << target;
    EXPECT_GE(organ->fixed_nodes.size(), 10u);
  }
  EXPECT_FALSE(catalogue::make_liver(catalogue::kMinLiverTets - 1).ok());
  EXPECT_FALSE(catalogue::make_liver(catalogue::kMaxLiverTets + 1).ok());
}

TEST(Liver, HasTheLandmarksOfALiver) {
  const auto inside = [](double x, double y, double z) {
    return catalogue::liver_field({x, y, z}) < 0;
  };
  // The right lobe reaches higher and lower than the left one, and is thicker.
  EXPECT_TRUE(inside(-0.05, 0.065, -0.01));
  EXPECT_FALSE(inside(0.08, 0.065, 0.01));
  EXPECT_TRUE(inside(-0.09, -0.055, 0.02));
  EXPECT_FALSE(inside(0.08, -0.02, 0.02));
  EXPECT_TRUE(inside(0.08, 0.03, 0.02));
  // Gallbladder fossa and umbilical fissure are hollows between solid banks.
  const auto lowest_at = [&](double x, double z) {
    double y = 0.04;
    while (inside(x, y, z)) y -= 0.0005;
    return y;
  };
  EXPECT_GT(lowest_at(-0.036, 0.035), lowest_at(-0.065, 0.035) + 0.008);
  EXPECT_GT(lowest_at(0.017, 0.03), lowest_at(-0.006, 0.03) + 0.008);
  // The bed of the vena cava, behind.
  EXPECT_FALSE(inside(-0.012, 0.01, -0.055));
  EXPECT_TRUE(inside(-0.045, 0.01, -0.055));
  // The visceral surface is hollow: its middle lies above the chord between its borders.
  const double chord = (lowest_at(-0.068, -0.04) + lowest_at(-0.068, 0.02)) / 2;
  EXPECT_GT(lowest_at(-0.068, -0.01), chord + 0.001);
}

TEST(Liver, InferiorBorderIsSharpAndTheDomeIsNot) {
  const auto organ = catalogue::make_liver(40000);
  ASSERT_TRUE(organ.ok());
  EXPECT_LT(sharpest_edge(organ->mesh, {-0.10, -0.08, 0.0}, {0.10, 0.02, 0.08}), 120);
  EXPECT_GT(sharpest_edge(organ->mesh, {-0.10, 0.04, -0.02}, {-0.02, 0.1, 0.06}), 155);
}

TEST(Liver, IsHeldBehindAndAboveAndFreeInFront) {
  const auto organ = catalogue::make_liver();
  ASSERT_TRUE(organ.ok());
  const auto& mesh = organ->mesh;
  int bare_area = 0, falciform = 0;
  for (const NodeIndex node : organ->fixed_nodes) {
    const Vec3d& p = mesh.rest_positions[node.value];
    EXPECT_TRUE(mesh.is_surface_node[node.value]);
    EXPECT_TRUE(p.z < 0 || p.y > 0.03) << p.x << ' ' << p.y << ' ' << p.z;
    bare_area += p.z < -0.03 && p.x < -0.02;
    falciform += p.z > 0.01;
  }
  EXPECT_GT(bare_area, 30);
  EXPECT_GT(falciform, 5);
}

}  // namespace
}  // namespace trocar::organ
