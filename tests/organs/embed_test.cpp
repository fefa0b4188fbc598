// A fine surface for an organ: compared with its mesh, kept in its file, moved with its rest pose.

#include "server/organs/embed/embed.h"

#include <gtest/gtest.h>

#include <utility>

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
  return {.unit = mesh::Unit::Millimetre, .offset_m = offset_m, .picture = {}, .name = "fine.obj"};
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
  EXPECT_NE(fine.error().message.find("mm from the surface of the mesh, may be"),
            std::string::npos);
  const auto other_unit = embed(raw, organ_.mesh, {.offset_m = offset_, .name = "fine.obj"});
  ASSERT_FALSE(other_unit.ok());
  EXPECT_NE(other_unit.error().message.find("same unit"), std::string::npos);
}

TEST_F(Embed, TheOrgansFileKeepsItAndItsHashDoesNotKnowIt) {
  const auto hash = organ::organ_hash(organ_);
  auto options = options_of(offset_);
  options.picture = "\x89PNG\r\n\x1a\nrest";
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
