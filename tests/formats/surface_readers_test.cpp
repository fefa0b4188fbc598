#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <string>
#include <variant>

#include "server/organs/formats/mesh_file.h"
#include "server/organs/formats/obj_reader.h"
#include "server/organs/formats/ply_reader.h"
#include "server/organs/formats/stl_reader.h"
#include "server/organs/surface/closed_surface.h"
#include "tests/formats/reader_samples.h"

namespace trocar::formats {
namespace {

using testing::changed;
using testing::error_of;
using testing::kObj;
using testing::kPly;
using testing::kStl;

// The solid is a corner of the unit cube, a sixth of it.
void expect_the_solid(Result<surface::RawSurface> raw) {
  ASSERT_TRUE(raw.ok()) << raw.error().message;
  EXPECT_EQ(raw->positions.size(), 4u);
  EXPECT_EQ(raw->triangles.size(), 4u);
  const auto solid = surface::check_surface(std::move(*raw), mesh::Unit::Metre, "a");
  ASSERT_TRUE(solid.ok()) << solid.error().message;
  EXPECT_TRUE(solid->warnings.empty());
  EXPECT_NEAR(solid->volume_m3, 1.0 / 6, 1e-15);
}

TEST(SurfaceReaders, AFileMaySayItsAxes) {
  const auto axes_of = [](const std::string& text, const std::string& name) {
    auto read = parse_mesh(text, name);
    EXPECT_TRUE(read.ok()) << read.error().message;
    return read.ok() ? std::get<surface::RawSurface>(*read).axes : surface::Axes::Unsaid;
  };
  EXPECT_EQ(axes_of(kObj, "a.obj"), surface::Axes::Unsaid);
  EXPECT_EQ(axes_of("# 3D Slicer output. SPACE=RAS\n" + kObj, "a.obj"), surface::Axes::Ras);
  EXPECT_EQ(axes_of("# 3D Slicer output. SPACE=LPS\n" + kObj, "a.obj"), surface::Axes::Lps);
}

template <typename T>
void put(std::string& out, T value, bool is_big_endian = false) {
  std::string bytes(reinterpret_cast<const char*>(&value), sizeof value);
  if (is_big_endian) bytes.assign(bytes.rbegin(), bytes.rend());
  out += bytes;
}

std::string binary_stl() {
  std::string text = "solid of a program that writes this into binary files";
  text.resize(80, ' ');
  put(text, std::uint32_t{4});
  const float corners[4][9] = {{0, 0, 0, 0, 1, 0, 1, 0, 0},
                               {0, 0, 0, 1, 0, 0, 0, 0, 1},
                               {1, 0, 0, 0, 1, 0, 0, 0, 1},
                               {0, 0, 0, 0, 0, 1, 0, 1, 0}};
  for (const auto& triangle : corners) {
    for (int i = 0; i < 3; ++i) put(text, 0.0f);
    for (const float c : triangle) put(text, c);
    put(text, std::uint16_t{0});
  }
  return text;
}

TEST(SurfaceReaders, ReadTheSameSolid) {
  expect_the_solid(parse_obj(kObj, "a.obj"));
  expect_the_solid(parse_ply(kPly, "a.ply"));
  expect_the_solid(parse_stl(kStl, "a.stl"));
  expect_the_solid(parse_stl(binary_stl(), "a.stl"));
}

TEST(SurfaceReaders, ReadBinaryPlyOfEitherOrder) {
  for (const bool is_big : {false, true}) {
    std::string text = changed(kPly.substr(0, kPly.find("end_header")), "ascii",
                               is_big ? "binary_big_endian" : "binary_little_endian") +
                       "end_header\n";
    const float points[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (const auto& point : points) {
      for (const float c : point) put(text, c, is_big);
      put(text, std::uint8_t{1});
    }
    const std::int32_t faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
    for (const auto& face : faces) {
      put(text, std::uint8_t{3});
      for (const auto i : face) put(text, i, is_big);
    }
    expect_the_solid(parse_ply(text, "a.ply"));
    for (std::size_t n = 0; n < text.size(); ++n)
      EXPECT_FALSE(parse_ply(std::string_view(text).substr(0, n), "a.ply").ok()) << n;
  }
}

TEST(SurfaceReaders, SplitFacesOfMoreCorners) {
  const auto raw = parse_obj("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nf 1 2 3\n", "a.obj");
  ASSERT_TRUE(raw.ok()) << raw.error().message;
  EXPECT_EQ(raw->face_numbers, (std::vector<std::int64_t>{1, 1, 2}));
}

// A prism of 30 over an L of 60 x 60, whose arms are 20 wide.
std::string prism_over_an_l() {
  std::string text;
  for (const char* z : {"0", "30"})
    for (const char* xy : {"0 0", "60 0", "60 20", "20 20", "20 60", "0 60"})
      text += std::string("v ") + xy + " " + z + "\n";
  return text +
         "f 6 5 4 3 2 1\nf 8 9 10 11 12 7\nf 1 2 8 7\nf 2 3 9 8\nf 3 4 10 9\nf 4 5 11 10\n"
         "f 5 6 12 11\nf 6 1 7 12\n";
}

TEST(SurfaceReaders, CutConcaveFacesEarByEar) {
  // A face may begin with any of its corners; around four of them triangles overlap.
  for (const char* top : {"8 9 10 11 12 7", "9 10 11 12 7 8", "10 11 12 7 8 9", "11 12 7 8 9 10",
                          "12 7 8 9 10 11", "7 8 9 10 11 12"}) {
    auto raw = parse_obj(changed(prism_over_an_l(), "8 9 10 11 12 7", top), "a.obj");
    ASSERT_TRUE(raw.ok()) << raw.error().message;
    EXPECT_EQ(raw->triangles.size(), 4u + 4u + 6u * 2u);
    const auto solid = surface::check_surface(std::move(*raw), mesh::Unit::Millimetre, "a");
    ASSERT_TRUE(solid.ok()) << top << ": " << solid.error().message;
    EXPECT_TRUE(solid->warnings.empty());
    EXPECT_NEAR(solid->volume_m3, 60e-6, 1e-12);
  }
  const auto ply = parse_ply(
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
      "0 3 0\n-2 0 0\n0 1 0\n2 0 0\n4 3 0 1 2\n",
      "a.ply");
  ASSERT_TRUE(ply.ok()) << ply.error().message;
  ASSERT_EQ(ply->triangles.size(), 2u);
  for (const auto& t : ply->triangles)  // each has a half of the arrowhead
    EXPECT_TRUE(std::ranges::count(t, NodeIndex(0)) == 1 &&
                std::ranges::count(t, NodeIndex(2)) == 1);
}

// It has no right cut. A surface that must be closed is refused later.
TEST(SurfaceReaders, CutAFaceThatCrossesItselfAroundItsFirstCorner) {
  const auto raw = parse_obj("v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 4\n", "a.obj");
  ASSERT_TRUE(raw.ok()) << raw.error().message;
  EXPECT_EQ(raw->triangles.size(), 2u);
}

TEST(SurfaceReaders, RefuseConcaveFacesOfManyCorners) {
  const auto zigzag = [](int corners) {
    std::string text = "v " + std::to_string(corners) + " 5000 0\nv 0 5000 0\n", face = "f 1 2";
    for (int i = 3; i <= corners; ++i) {
      text += "v " + std::to_string(i) + " " + std::to_string(i % 2 * 4000) + " 0\n";
      face += " " + std::to_string(i);
    }
    return text + face + "\n";
  };
  const auto most = parse_obj(zigzag(128), "a.obj");
  ASSERT_TRUE(most.ok()) << most.error().message;
  EXPECT_EQ(most->triangles.size(), 126u);
  EXPECT_EQ(error_of(zigzag(129), "a.obj"),
            "a.obj:130: face 1 is concave and has 129 corners, may have 128: save it as "
            "triangles");
}

TEST(ObjReader, CornersOfAConcaveFaceKeepTheirPlacesInAPicture) {
  const auto raw = parse_obj(
      "v 0 3 0\nv -2 0 0\nv 0 1 0\nv 2 0 0\nvt 0 3\nvt -2 0\nvt 0 1\nvt 2 0\n"
      "f 4/4 1/1 2/2 3/3\n",
      "a.obj");
  ASSERT_TRUE(raw.ok()) << raw.error().message;
  ASSERT_EQ(raw->triangles.size(), 2u);
  ASSERT_EQ(raw->corner_texture.size(), 2u);
  for (std::size_t t = 0; t < 2; ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3d& p = raw->positions[raw->triangles[t][k].value];
      EXPECT_EQ(raw->corner_texture[t][k], (std::array{p.x, p.y}));
    }
}

TEST(ObjReader, CornersHaveTheirPlacesInAPicture) {
  const std::string text =
      "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 0.5\n"
      "f 1/1/1 2/2 3/3 4/-1\n";
  const auto raw = parse_obj(text, "a.obj");
  ASSERT_TRUE(raw.ok()) << raw.error().message;
  ASSERT_EQ(raw->corner_texture.size(), 2u);
  EXPECT_EQ(raw->corner_texture[1][2], (std::array<double, 2>{0, 0.5}));
  // None has one if a corner lacks it.
  const auto some = parse_obj(text + "f 1 2 3\n", "a.obj");
  ASSERT_TRUE(some.ok());
  EXPECT_TRUE(some->corner_texture.empty());
}

// Many programs write them so, and the surface itself is as it should be.
TEST(ObjReader, WrongPlacesInAPictureAreLeftOutAndSaid) {
  const std::string text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\n";
  const auto fault_of = [](const std::string& file) {
    const auto raw = parse_obj(file, "a.obj");
    EXPECT_TRUE(raw.ok()) << raw.error().message;
    EXPECT_EQ(raw->triangles.size(), 1u);
    EXPECT_TRUE(raw->corner_texture.empty());
    return raw->texture_fault;
  };
  EXPECT_EQ(fault_of(text + "f 1/1 2/5 3/1\n"),
            "a.obj:6: refers to texture coordinate 5, the file has 2");
  EXPECT_EQ(fault_of("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1/1 2/2 3/3\n"),
            "a.obj:4: refers to texture coordinate 1, the file has 0");
  EXPECT_EQ(fault_of(text + "f 1/1 2/-3 3/1\n"),
            "a.obj:6: face 1 refers to texture coordinate '-3', 2 come before it");
  EXPECT_EQ(fault_of(text + "f 1/1 2/0 3/x\n"),
            "a.obj:6: face 1 refers to texture coordinate '0', must be a whole number other than "
            "0");
  EXPECT_EQ(fault_of(text + "vt nan 0\nf 1/1 2/2 3/3\n"),
            "a.obj:6: texture coordinate 3: is not a finite number");
  EXPECT_EQ(fault_of(text + "f 1 2 3\n"), "");
}

TEST(SurfaceReaders, ErrorsSayWhereAndWhat) {
  const auto expect = [](const std::string& text, const std::string& name, const char* part) {
    ASSERT_FALSE(text.empty()) << part;
    EXPECT_NE(error_of(text, name).find(part), std::string::npos) << error_of(text, name);
  };
  expect(changed(kObj, "f 1 2 4", "f 1 2 5"), "a.obj", "a.obj:9: face 2 refers to vertex 5");
  expect(changed(kObj, "f 1 2 4", "f 1 2 0"), "a.obj", "must be a whole number other than 0");
  expect(changed(kObj, "f 1 2 4", "f 1 2 -9"), "a.obj",
         "a.obj:9: face 2 refers to vertex '-9', 4 come before it");
  expect(changed(kObj, "f 1 2 4", "f 1 2"), "a.obj", "face 2 has 2 corners");
  expect(changed(kObj, "v 1 0 0", "v 1 0"), "a.obj", "a.obj:4: vertex 2: coordinate ''");
  expect(changed(kObj, "vn 0", "curv 0"), "a.obj", "'curv' is not known");
  expect(changed(kPly, "element vertex 4", "element vertex 4000000000"), "a.ply",
         "announces 4000000000 vertex");
  expect(changed(kPly, "3 0 2 1", "3 0 2 7"), "a.ply", "face 1 refers to vertex 8");
  expect(changed(kPly, "3 0 2 1", "9999 0 2 1"), "a.ply", "has a length that is not 0 to 1000");
  expect(changed(kPly, "property float x", "property float u"), "a.ply",
         "vertices need the properties x, y and z");
  expect(changed(kStl, "vertex 1 0 0", "vertex 1 0 nan"), "a.stl",
         "triangle 1: coordinate 'nan' is not a finite number");
  expect(changed(kStl, "endloop", "vertex"), "a.stl", "expected 'endloop'");
  expect(binary_stl().substr(0, 200), "a.stl", "announces 4 triangles, 116 bytes follow");
}

}  // namespace
}  // namespace trocar::formats
