// A fine surface for an organ: compared with its mesh, kept in its file, moved with its rest pose.

#include "server/organs/embed/embed.h"

#include <gtest/gtest.h>
#include <turbojpeg.h>

#include <memory>
#include <utility>
#include <vector>

#include "common/image/image.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/organ/organ_file.h"

namespace trocar::embed {
namespace {

// The mesh's own surface, in millimetres and moved, with a picture's places.
surface::RawSurface raw_of(const mesh::TetMesh& mesh, const Vec3d& offset_m) {
  surface::RawSurface raw;
  for (const Vec3d& p : mesh.rest_positions) raw.positions.push_back((p + offset_m) * 1e3);
  raw.triangles = mesh.boundary_triangles;
  for (std::size_t t = 0; t < raw.triangles.size(); ++t) {
    raw.face_numbers.push_back(static_cast<std::int64_t>(t) + 1);
    raw.corner_texture.push_back({{{0, 0}, {1, 0}, {0.5, 1}}});
  }
  return raw;
}

EmbedOptions options_of(const Vec3d& offset_m) {
  return {.unit_m = 1e-3,
          .axes = surface::Axes::Unsaid,
          .offset_m = offset_m,
          .picture = {},
          .picture_name = "pic.png",
          .name = "fine.obj"};
}

std::vector<std::uint8_t> colours(int width, int height) {
  std::vector<std::uint8_t> rgb;
  for (int i = 0; i < 3 * width * height; ++i)
    rgb.push_back(static_cast<std::uint8_t>(i % 251 * (i % 7)));
  return rgb;
}

std::string png(int width, int height) {
  auto file = image::encode_png(width, height, colours(width, height));
  EXPECT_TRUE(file.ok());
  return file.ok() ? *file : std::string();
}

std::string jpeg(int width, int height) {
  const std::unique_ptr<void, int (*)(tjhandle)> writer(tjInitCompress(), tjDestroy);
  const auto rgb = colours(width, height);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  EXPECT_EQ(tjCompress2(writer.get(), rgb.data(), width, 0, height, TJPF_RGB, &bytes, &size,
                        TJSAMP_420, 90, TJFLAG_PROGRESSIVE),
            0);
  std::string file(reinterpret_cast<const char*>(bytes), size);
  tjFree(bytes);
  return file;
}

class Embed : public testing::Test {
 protected:
  organ::Organ organ_ = *catalogue::make_liver(5000);
  Vec3d offset_{0.3, -0.2, 0.1};
};

TEST_F(Embed, TheSameSurfaceFits) {
  const auto raw = raw_of(organ_.mesh, offset_);
  const auto fine = embed(raw, organ_.mesh, options_of(offset_));
  ASSERT_TRUE(fine.ok()) << fine.error().message;
  EXPECT_LT(fine->farthest_m, 1e-6);  // the grid of 0.5 um
  EXPECT_EQ(fine->surface.triangles.size(), raw.triangles.size());
  EXPECT_TRUE(fine->warnings.empty());
  EXPECT_FALSE(fine->surface.texture.empty());
}

// A label map's x, y, z here are the patient's left, head and front.
TEST_F(Embed, ThePatientsAxesAreTurnedAsThoseOfALabelMap) {
  const auto plain = raw_of(organ_.mesh, offset_);
  const auto straight = embed(plain, organ_.mesh, options_of(offset_));
  ASSERT_TRUE(straight.ok());
  for (const auto axes : {surface::Axes::Ras, surface::Axes::Lps}) {
    auto raw = plain;
    const double side = axes == surface::Axes::Ras ? -1 : 1;  // towards the left, and the back
    for (Vec3d& p : raw.positions) p = {side * p.x, -side * p.z, p.y};
    auto options = options_of(offset_);
    options.axes = axes;
    const auto fine = embed(raw, organ_.mesh, options);
    ASSERT_TRUE(fine.ok()) << fine.error().message;
    EXPECT_TRUE(fine->warnings.empty()) << "it is no mirror image";
    EXPECT_EQ(fine->surface, straight->surface);
    // An error names the place as the file has it.
    raw.positions[organ_.mesh.boundary_triangles[0][0].value] = {70, 400, 5};
    const auto far = embed(raw, organ_.mesh, options);
    ASSERT_FALSE(far.ok());
    EXPECT_NE(far.error().message.find("the vertex at 70 400 5 is"), std::string::npos)
        << far.error().message;
  }
}

// A surface that is imported stays in the axes that it says.
TEST_F(Embed, AxesThatDifferFromTheOrgansAreTurnedIntoThose) {
  auto raw = raw_of(organ_.mesh, offset_);
  const auto straight = embed(raw, organ_.mesh, options_of(offset_));
  auto options = options_of(offset_);
  options.organ_axes = options.axes = surface::Axes::Lps;
  EXPECT_EQ(embed(raw, organ_.mesh, options)->surface, straight->surface);
  options.axes = surface::Axes::Ras;
  for (Vec3d& p : raw.positions) p = {-p.x, -p.y, p.z};
  EXPECT_EQ(embed(raw, organ_.mesh, options)->surface, straight->surface);
  options.axes = surface::Axes::LeftHeadFront;
  for (Vec3d& p : raw.positions) p = {-p.x, p.z, p.y};
  EXPECT_EQ(embed(raw, organ_.mesh, options)->surface, straight->surface);
}

TEST_F(Embed, OneThatLooksInwardIsTurned) {
  auto raw = raw_of(organ_.mesh, offset_);
  for (auto& t : raw.triangles) std::swap(t[0], t[1]);
  raw.corner_texture.clear();
  const auto fine = embed(raw, organ_.mesh, options_of(offset_));
  ASSERT_TRUE(fine.ok());
  ASSERT_EQ(fine->warnings.size(), 1u);
  EXPECT_NE(fine->warnings[0].find("inward"), std::string::npos);
}

TEST_F(Embed, OneThatIsElsewhereIsRefusedWithThePlace) {
  auto raw = raw_of(organ_.mesh, offset_);
  const auto mesh_far = organ_.mesh.boundary_triangles[0][0].value;
  raw.positions[mesh_far] = raw.positions[mesh_far] + Vec3d{0, 0, 500};
  const auto fine = embed(raw, organ_.mesh, options_of(offset_));
  ASSERT_FALSE(fine.ok());
  EXPECT_NE(fine.error().message.find("fine.obj: the vertex at "), std::string::npos);
  EXPECT_NE(fine.error().message.find("mm from the surface of the mesh, and"), std::string::npos);
  // The file's first faces have more corners than three.
  for (auto& number : raw.face_numbers) number = 7;
  const auto other_unit = embed(raw, organ_.mesh, {.offset_m = offset_, .name = "fine.obj"});
  ASSERT_FALSE(other_unit.ok());
  EXPECT_NE(other_unit.error().message.find("fine.obj: face 7: "), std::string::npos);
  EXPECT_NE(other_unit.error().message.find("same unit"), std::string::npos);
}

// A rim that is thinner than the lattice is not in a mesh made from the same surface.
TEST_F(Embed, AFewVerticesMayBeFartherAwayAndAreTold) {
  auto raw = raw_of(organ_.mesh, offset_);
  const auto corner = organ_.mesh.boundary_triangles[0][0].value;
  const Vec3d p = organ_.mesh.rest_positions[corner];
  const double edge =
      length(organ_.mesh.rest_positions[organ_.mesh.boundary_triangles[0][1].value] - p);
  raw.positions[corner] = raw.positions[corner] + p * (1e3 * edge / length(p));
  const auto fine = embed(raw, organ_.mesh, options_of(offset_));
  ASSERT_TRUE(fine.ok()) << fine.error().message;
  ASSERT_EQ(fine->warnings.size(), 1u);
  EXPECT_NE(fine->warnings[0].find("1 of "), std::string::npos) << fine->warnings[0];
  // The same distance of a tenth of them is another place.
  for (std::size_t t = 0; t < raw.triangles.size() / 10; ++t) {
    auto& q = raw.positions[raw.triangles[t][0].value];
    q = q + normalized(q * 1e-3 - offset_, Vec3d{}) * (1e3 * edge);
  }
  const auto moved = embed(raw, organ_.mesh, options_of(offset_));
  ASSERT_FALSE(moved.ok());
  EXPECT_NE(moved.error().message.find("is it the same organ"), std::string::npos);
}

TEST_F(Embed, TheOrgansFileKeepsItAndItsHashDoesNotKnowIt) {
  const auto hash = organ::organ_hash(organ_);
  auto options = options_of(offset_);
  options.picture = png(60, 40);
  organ_.fine_surface = embed(raw_of(organ_.mesh, offset_), organ_.mesh, options)->surface;
  EXPECT_EQ(organ::organ_hash(organ_), hash);
  const auto read_back = organ::unpack_organ(organ::pack_organ(organ_));
  ASSERT_TRUE(read_back.ok()) << read_back.error().message;
  EXPECT_EQ(*read_back, organ_);
  organ_.fine_surface.triangles[3][1] = 1'000'000;
  const auto broken = organ::unpack_organ(organ::pack_organ(organ_));
  ASSERT_FALSE(broken.ok());
  EXPECT_NE(broken.error().message.find("FineSurface.corner_step"), std::string::npos);
}

TEST_F(Embed, VerticesOfDroppedTrianglesAreNotKept) {
  auto raw = raw_of(organ_.mesh, offset_);
  const auto whole = embed(raw, organ_.mesh, options_of(offset_));
  // Three places in a line: near, but no surface.
  const Vec3d from = raw.positions[raw.triangles[0][0].value];
  const auto first = static_cast<std::uint32_t>(raw.positions.size());
  raw.positions.insert(raw.positions.end(), {from + Vec3d{0.01, 0, 0}, from + Vec3d{0.02, 0, 0},
                                             from + Vec3d{0.03, 0, 0}});
  raw.triangles.push_back({NodeIndex(first), NodeIndex(first + 1), NodeIndex(first + 2)});
  raw.corner_texture.push_back({});
  const auto fine = embed(raw, organ_.mesh, options_of(offset_));
  ASSERT_TRUE(fine.ok()) << fine.error().message;
  EXPECT_EQ(fine->surface, whole->surface);
  ASSERT_EQ(fine->warnings.size(), 1u);
  EXPECT_EQ(fine->warnings[0], "dropped 1 triangles without an area");
}

TEST_F(Embed, PicturesThatNoClientWouldShowAreRefused) {
  auto options = options_of(offset_);
  const auto raw = raw_of(organ_.mesh, offset_);
  const auto error = [&](const std::string& picture) {
    options.picture = picture;
    const auto fine = embed(raw, organ_.mesh, options);
    return fine.ok() ? std::string() : fine.error().message;
  };
  EXPECT_EQ(error(png(2048, 1)), "");
  EXPECT_EQ(error(jpeg(32, 2048)), "");
  EXPECT_EQ(error(png(2049, 1)), "pic.png: has 2049 x 1 pixels, may have 1 to 2048 along a side");
  EXPECT_EQ(error(jpeg(32, 2049)),
            "pic.png: has 32 x 2049 pixels, may have 1 to 2048 along a side");
  const std::string no_width("\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\0\0\0\0\1", 24);
  EXPECT_EQ(error(no_width), "pic.png: has 0 x 1 pixels, may have 1 to 2048 along a side");
  EXPECT_NE(error("\xff\xd8\xff and no more").find("its header is broken"), std::string::npos);
  EXPECT_EQ(error(png(1, 1) + std::string(4 << 20, ' ')).find("pic.png: has 41"), 0u);
}

// Each client would unpack it, fail and draw the surface without it.
TEST_F(Embed, DamagedPicturesAreRefused) {
  auto options = options_of(offset_);
  const auto raw = raw_of(organ_.mesh, offset_);
  for (const auto& whole : {png(60, 40), jpeg(60, 40)}) {
    options.picture = whole;
    EXPECT_TRUE(embed(raw, organ_.mesh, options).ok());
    options.picture = whole.substr(0, whole.size() / 2);
    const auto fine = embed(raw, organ_.mesh, options);
    ASSERT_FALSE(fine.ok());
    EXPECT_EQ(fine.error().message.find("pic.png: cannot be unpacked (picture: "), 0u)
        << fine.error().message;
    EXPECT_EQ(fine.error().message.find('\n'), std::string::npos);
  }
  options.picture_name.clear();  // as that of a .glb file
  EXPECT_EQ(
      embed(raw, organ_.mesh, options).error().message.find("fine.obj: its picture cannot be "),
      0u);
}

TEST_F(Embed, APictureNeedsTextureCoordinates) {
  auto options = options_of(offset_);
  options.picture = png(8, 8);
  auto raw = raw_of(organ_.mesh, offset_);
  raw.corner_texture.clear();
  const auto fine = embed(raw, organ_.mesh, options);
  ASSERT_FALSE(fine.ok());
  EXPECT_EQ(fine.error().message, "fine.obj: has no texture coordinates for the picture pic.png");
}

TEST_F(Embed, WrongPlacesInAPictureAreRefused) {
  auto raw = raw_of(organ_.mesh, offset_);
  raw.texture_fault = "fine.obj:6: refers to texture coordinate 5, the file has 2";
  const auto fine = embed(raw, organ_.mesh, options_of(offset_));
  ASSERT_FALSE(fine.ok());
  EXPECT_EQ(fine.error().message, raw.texture_fault);
}

TEST_F(Embed, IsCarriedToAnotherRestPose) {
  auto fine = embed(raw_of(organ_.mesh, offset_), organ_.mesh, options_of(offset_))->surface;
  const auto before = fine;
  const Vec3d move{0.001, -0.002, 0.003};
  std::vector<Vec3d> now;
  for (const Vec3d& p : organ_.mesh.rest_positions) now.push_back(p + move);
  carry(organ_.mesh, now, fine);
  for (std::size_t v = 0; v < fine.quanta.size(); ++v)
    ASSERT_LT(length(fine.position_m(v) - before.position_m(v) - to_float(move)), 1e-6f);
}

}  // namespace
}  // namespace trocar::embed
