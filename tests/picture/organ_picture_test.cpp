#include "server/organs/picture/organ_picture.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace trocar::picture {
namespace {

// The tetrahedron is 0.2 m wide and lies around the origin.
mesh::TetMesh tetrahedron() {
  mesh::TetMesh mesh;
  mesh.rest_positions = {
      {-0.1, -0.1, -0.1}, {0.1, -0.1, -0.1}, {-0.1, 0.1, -0.1}, {-0.1, -0.1, 0.1}};
  mesh.tets = {{NodeIndex(0), NodeIndex(1), NodeIndex(2), NodeIndex(3)}};
  mesh.build_adjacency();
  return mesh;
}

TEST(OrganPicture, ShowsTheOrganOnceInEachView) {
  const auto mesh = tetrahedron();
  auto picture = draw_organ(mesh, {0, 0, 0, 0}, {0, 0, 0, 0});
  ASSERT_EQ(picture.width % 3, 0);
  const int view = picture.width / 3;
  const Colour ground{255, 255, 255};
  for (int v = 0; v < 3; ++v) {
    int drawn = 0;
    for (int y = 0; y < view; ++y)
      for (int x = v * view; x < (v + 1) * view; ++x) drawn += picture.at(x, y) != ground;
    // Each view shows half of the square around the tetrahedron, which leaves a margin.
    EXPECT_GT(drawn, view * view / 4);
    EXPECT_LT(drawn, view * view / 2);
  }
}

TEST(OrganPicture, HeldNodesAreDarkerAndRegionsOfOtherColours) {
  const auto mesh = tetrahedron();
  const auto plain = draw_organ(mesh, {0, 0, 0, 0}, {0, 0, 0, 0});
  const auto held = draw_organ(mesh, {0, 0, 0, 0}, {1, 1, 1, 1});
  const auto region = draw_organ(mesh, {1, 1, 1, 1}, {0, 0, 0, 0});
  const auto sum = [](const Picture& picture) {
    std::uint64_t all = 0;
    for (const Colour& c : picture.pixels) all += c[0] + c[1] + c[2];
    return all;
  };
  EXPECT_LT(sum(held), sum(plain));
  EXPECT_NE(region.pixels, plain.pixels);
  EXPECT_EQ(draw_organ(mesh, {0, 0, 0, 0}, {0, 0, 0, 0}).pixels, plain.pixels);
  EXPECT_EQ(scale_bar_m(mesh), 0.1);
}

// The square of the fine surface lies before the tetrahedron's back face and looks to the front;
// all of a picture is painted on it.
wire::FineSurface square() {
  wire::FineSurface fine;
  const int side = 160'000;
  fine.quanta = {{-side, -side, 0}, {side, -side, 0}, {side, side, 0}, {-side, side, 0}};
  fine.triangles = {{0, 1, 2}, {0, 2, 3}};
  fine.texture = {{0, 0}, {32768, 0}, {32768, 32768}, {0, 32768}};
  return fine;
}

TEST(OrganPicture, AFineSurfaceTakesTheMeshsPlaceWithItsPicture) {
  const auto mesh = tetrahedron();
  const image::Image painted{
      2, 2, {{0, 200, 0, 255}, {0, 0, 200, 255}, {200, 0, 0, 255}, {200, 0, 0, 255}}};
  const auto plain = draw_organ(mesh, {0, 0, 0, 0}, {0, 0, 0, 0}, square());
  auto picture = draw_organ(mesh, {0, 0, 0, 0}, {0, 0, 0, 0}, square(), painted);
  const int view = picture.width / 3;
  const Colour ground{255, 255, 255};
  const auto at = [view](Picture& of, int right, int up) {
    return of.at(view / 2 + right, view / 2 - up);
  };
  const Colour left = at(picture, -40, 40), right = at(picture, 40, 40),
               below = at(picture, -40, -40);
  EXPECT_TRUE(left[0] == 0 && left[1] > 100 && left[2] == 0) << int(left[1]);
  EXPECT_TRUE(right[0] == 0 && right[1] == 0 && right[2] > 100) << int(right[2]);
  EXPECT_TRUE(below[0] > 100 && below[1] == 0 && below[2] == 0) << int(below[0]);
  // The mesh has nothing there, and what it has elsewhere is not drawn.
  EXPECT_EQ(at(picture, -170, 170), ground);
  EXPECT_EQ(picture.at(view + view / 2 + 60, view / 2 + 100), ground) << "the square has no depth";
  EXPECT_NE(plain.pixels, picture.pixels);
  // Held nodes are dark and regions coloured, whatever is painted.
  auto held = draw_organ(mesh, {0, 0, 0, 0}, {1, 1, 1, 1}, square(), painted);
  EXPECT_LT(at(held, -40, 40)[1], left[1]);
  auto region = draw_organ(mesh, {1, 1, 1, 1}, {0, 0, 0, 0}, square(), painted);
  EXPECT_NE(at(region, -40, 40), left);
}

}  // namespace
}  // namespace trocar::picture
