#include "server/organs/mesh/stuffing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "server/organs/mesh/pieces.h"

namespace trocar::mesh {
namespace {

const Box kBox{{-1.2, -1.2, -1.2}, {1.2, 1.2, 1.2}};

SignedField ball(const Vec3d& centre, double radius) {
  return [=](const Vec3d& p) { return length(p - centre) - radius; };
}
SignedField torus(double radius, double tube) {
  return [=](const Vec3d& p) {
    const double ring = std::sqrt(p.x * p.x + p.z * p.z) - radius;
    return std::sqrt(ring * ring + p.y * p.y) - tube;
  };
}

// Vertices - edges + faces of the closed surface.
long euler_characteristic(const TetMesh& mesh) {
  const auto faces = static_cast<long>(mesh.boundary_triangles.size());
  return static_cast<long>(mesh.surface_nodes.size()) - faces * 3 / 2 + faces;
}

void expect_good(const TetMesh& mesh, const std::string& what) {
  const Status status = validate(mesh);  // closed, manifold, outward, positive
  ASSERT_TRUE(status) << what << ": " << status.error().message;
  EXPECT_EQ(find_pieces(mesh).count, 1u) << what;
  const auto angles = dihedral_range(mesh);
  EXPECT_GE(angles.min_deg, kStuffingMinDihedral_deg) << what;
  EXPECT_LE(angles.max_deg, kStuffingMaxDihedral_deg) << what;
}

TEST(Stuffing, BallConvergesAndHasNoHandles) {
  double last_error = 1;
  for (const double spacing : {0.4, 0.2, 0.1, 0.05}) {
    const auto mesh = stuff_isosurface(ball({0.01, -0.02, 0.03}, 1), kBox, spacing);
    ASSERT_TRUE(mesh.ok()) << mesh.error().message;
    expect_good(*mesh, "ball at " + std::to_string(spacing));
    EXPECT_EQ(euler_characteristic(*mesh), 2);
    const double exact = 4 * std::numbers::pi / 3;
    const double error = std::abs(total_volume(*mesh) - exact) / exact;
    EXPECT_LT(error, last_error / 3) << "volume error must fall with the square of the spacing";
    last_error = error;
    for (const NodeIndex node : mesh->surface_nodes)
      EXPECT_NEAR(length(mesh->rest_positions[node.value] - Vec3d{0.01, -0.02, 0.03}), 1, 1e-6);
  }
  EXPECT_LT(last_error, 0.002);
}

TEST(Stuffing, TorusKeepsItsHandle) {
  const auto mesh = stuff_isosurface(torus(0.8, 0.25), kBox, 0.1);
  ASSERT_TRUE(mesh.ok()) << mesh.error().message;
  expect_good(*mesh, "torus");
  EXPECT_EQ(euler_characteristic(*mesh), 0);
}

TEST(Stuffing, InnerTetsAreTheLatticesOwn) {
  const auto mesh = stuff_isosurface(ball({}, 1), kBox, 0.1);
  ASSERT_TRUE(mesh.ok());
  std::size_t inner = 0;
  for (std::size_t t = 0; t < mesh->tets.size(); ++t) {
    const auto& tet = mesh->tets[t];
    const bool deep = std::ranges::all_of(
        tet, [&](NodeIndex n) { return length(mesh->rest_positions[n.value]) < 0.8; });
    if (!deep) continue;
    ++inner;
    EXPECT_NEAR(tet_volume(*mesh, TetIndex(t)), 0.001 / 12, 1e-15);
  }
  EXPECT_GT(inner, 10000u);
}

TEST(Stuffing, HoldsItsPromisesOnRandomSolids) {
  std::mt19937 engine(20);
  // Numbers in [-1, 1) without the library's distributions, which differ between libraries.
  const auto random = [&] { return static_cast<double>(engine()) / 2147483648.0 - 1; };
  int made = 0;
  for (int i = 0; i < 60; ++i) {
    const Vec3d n = normalized(Vec3d{random(), random(), random()}, Vec3d{1, 0, 0});
    const Vec3d centre = Vec3d{random(), random(), random()} * 0.1;
    const Vec3d squeeze{1 + std::abs(random()), 1 + std::abs(random()), 1 + std::abs(random())};
    const double radius = 0.3 + 0.6 * std::abs(random()), offset = 0.2 * random();
    const double spacing = 0.08 + 0.08 * std::abs(random());
    const auto field = [&, kind = i % 4](const Vec3d& p) {
      const Vec3d q = p - centre;
      if (kind == 0) return length(q) - radius;
      if (kind == 1) return std::max(length(q) - radius, dot(n, q) - offset);
      if (kind == 2)
        return length(Vec3d{q.x * squeeze.x, q.y * squeeze.y, q.z * squeeze.z}) - radius;
      return torus(radius * 0.7, radius * 0.25)(q);
    };
    const auto mesh = stuff_isosurface(field, kBox, spacing);
    if (!mesh) {  // only where the solid is thinner than the lattice
      EXPECT_NE(mesh.error().message.find("smaller spacing"), std::string::npos);
      continue;
    }
    ++made;
    expect_good(*mesh, "solid " + std::to_string(i));
  }
  EXPECT_GT(made, 54);
}

TEST(Stuffing, KeepsTheLargestPieceOnly) {
  const auto two = [](const Vec3d& p) {
    return std::min(ball({-0.6, 0, 0}, 0.5)(p), ball({0.8, 0, 0}, 0.25)(p));
  };
  const auto mesh = stuff_isosurface(two, kBox, 0.08);
  ASSERT_TRUE(mesh.ok());
  expect_good(*mesh, "two balls");
  for (const Vec3d& p : mesh->rest_positions) EXPECT_LT(p.x, 0);
}

TEST(Stuffing, SamePointsSameMesh) {
  const auto once = stuff_isosurface(torus(0.8, 0.25), kBox, 0.11);
  const auto again = stuff_isosurface(torus(0.8, 0.25), kBox, 0.11);
  ASSERT_TRUE(once.ok() && again.ok());
  EXPECT_EQ(*once, *again);
}

TEST(Stuffing, RefusesWhatItCannotFill) {
  const auto message = [](const SignedField& field, const Box& box, double spacing) {
    const auto mesh = stuff_isosurface(field, box, spacing);
    return mesh.ok() ? std::string("accepted") : mesh.error().message;
  };
  const auto expect = [&](const std::string& text, const char* part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  expect(message([](const Vec3d&) { return 1.0; }, kBox, 0.2), "nothing of the solid");
  expect(message(ball({}, 5), kBox, 0.2), "reaches the box's border");
  expect(message([](const Vec3d&) { return NAN; }, kBox, 0.2), "reaches the box's border");
  expect(message(ball({}, 1), kBox, 0), "positive spacing");
  expect(message(ball({}, 1), kBox, NAN), "positive spacing");
  expect(message(ball({}, 1), kBox, 1e-6), "too small");
  expect(message(ball({}, 1), Box{{1, 1, 1}, {0, 0, 0}}, 0.1), "positive sides");
}

TEST(Pieces, PartsThatTouchAlongAnEdgeAreSeparated) {
  // The mesh is a tet of volume 1/6 and a larger one that touches it along the edge (0, 1).
  TetMesh mesh;
  mesh.rest_positions = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-2, 0, 0}, {0, -2, 0}};
  mesh.tets = {{NodeIndex(0), NodeIndex(2), NodeIndex(3), NodeIndex(1)},
               {NodeIndex(0), NodeIndex(4), NodeIndex(5), NodeIndex(1)}};
  EXPECT_EQ(find_pieces(mesh).count, 2u);
  EXPECT_EQ(drop_touching_parts(mesh), 1u);
  ASSERT_EQ(mesh.tets.size(), 1u);
  EXPECT_EQ(mesh.tets[0][1], NodeIndex(4));
  EXPECT_EQ(drop_unused_nodes(mesh), 2u);
  renumber_along_z(mesh);
  mesh.build_adjacency();
  EXPECT_TRUE(validate(mesh)) << validate(mesh).error().message;
}

}  // namespace
}  // namespace trocar::mesh
