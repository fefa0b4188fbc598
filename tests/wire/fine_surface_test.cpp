// The fine surface as messages: what is sent comes back, and what is wrong is named.

#include "common/wire/fine_surface.h"

#include <gtest/gtest.h>

#include <random>

#include "proto/fine_surface.pb.h"
#include "proto/wire.pb.h"

namespace trocar::wire {
namespace {

FineSurface surface_of(std::size_t triangles) {
  FineSurface surface;
  std::mt19937 random(7);
  const auto any = [&](int most) {
    return static_cast<std::int32_t>(random() % static_cast<unsigned>(2 * most + 1)) - most;
  };
  for (std::size_t v = 0; v < triangles + 2; ++v) {
    surface.quanta.push_back({any(400'000), any(400'000), any(400'000)});
    surface.texture.push_back({any(32768), any(32768)});
  }
  for (std::uint32_t t = 0; t < triangles; ++t) surface.triangles.push_back({t, t + 1, t + 2});
  surface.picture = "\x89PNG\r\n\x1a\n" + std::string(1000, 'x');
  return surface;
}

std::string error_of(const FineSurface& surface) {
  proto::FineSurface message;
  write(surface, message);
  const auto read_back = read(message);
  return read_back.ok() ? "" : read_back.error().message;
}

TEST(FineSurface, ComesBackInParts) {
  for (const std::size_t triangles : {1u, 1000u, 40'000u}) {
    const FineSurface surface = surface_of(triangles);
    FineSurfaceAssembler assembler;
    const auto parts = parts_of(surface);
    for (std::size_t i = 0; i < parts.size(); ++i) {
      EXPECT_LE(parts[i].payload().size(), kFinePartBytes);
      const auto is_whole = assembler.add(parts[i]);
      ASSERT_TRUE(is_whole.ok());
      EXPECT_EQ(*is_whole, i + 1 == parts.size());
    }
    EXPECT_EQ(assembler.take(), surface);
  }
  EXPECT_TRUE(parts_of({}).empty());
}

TEST(FineSurface, IsWithinHalfAMicrometre) {
  const Vec3d place{0.1234567, -0.0456789, 0.3};
  FineSurface surface;
  surface.quanta.push_back(fine_quanta(place));
  EXPECT_LT(length(to_double(surface.position_m(0)) - place), 0.5e-6);
}

TEST(FineSurface, WhatIsWrongIsNamed) {
  auto surface = surface_of(4);
  EXPECT_EQ(error_of(surface), "");
  surface.quanta[1][2] = kMaxFineQuanta + 1;
  EXPECT_NE(error_of(surface).find("position_step: a vertex is more than 2 m"), std::string::npos);
  surface = surface_of(4);
  surface.triangles[2][1] = 6;
  EXPECT_NE(error_of(surface).find("corner_step: vertex out of range"), std::string::npos);
  surface.triangles[2][1] = surface.triangles[2][0];
  EXPECT_NE(error_of(surface).find("a triangle has a corner twice"), std::string::npos);
  surface = surface_of(4);
  surface.texture.pop_back();
  EXPECT_NE(error_of(surface).find("texture_step: not two numbers"), std::string::npos);
  surface = surface_of(4);
  surface.texture[0][0] = kMaxTextureQuanta + 1;
  EXPECT_NE(error_of(surface).find("texture_step: beyond"), std::string::npos);
  surface = surface_of(4);
  surface.picture = "GIF89a";
  EXPECT_NE(error_of(surface).find("picture: neither PNG nor JPEG"), std::string::npos);
  surface = surface_of(4);
  surface.texture.clear();
  EXPECT_NE(error_of(surface).find("no texture coordinates"), std::string::npos);
  surface = surface_of(4);
  surface.picture.resize(kMaxFinePictureBytes + 1);
  EXPECT_NE(error_of(surface).find("more than 4 MiB"), std::string::npos);
  EXPECT_NE(error_of(surface_of(kMaxFineTriangles + 1)).find("200,000 triangles"),
            std::string::npos);
}

TEST(FineSurface, PartsOutOfOrderAreRefused) {
  const auto parts = parts_of(surface_of(10'000));
  ASSERT_GT(parts.size(), 3u);
  FineSurfaceAssembler assembler;
  EXPECT_FALSE(assembler.add(parts[1]).ok());
  ASSERT_TRUE(assembler.add(parts[0]).ok());
  EXPECT_FALSE(assembler.add(parts[2]).ok());
  auto wrong = parts[0];
  wrong.set_parts(kMaxFineParts + 1);
  EXPECT_FALSE(assembler.add(wrong).ok());
  wrong = parts[0];
  wrong.mutable_payload()->append(kFinePartBytes, 'x');
  EXPECT_FALSE(assembler.add(wrong).ok());
  wrong = parts[0];
  wrong.clear_payload();
  EXPECT_FALSE(assembler.add(wrong).ok());
  // The first part begins anew.
  for (const auto& part : parts) ASSERT_TRUE(assembler.add(part).ok());
}

TEST(FineSurface, DamagedPartsNeverHarm) {
  const auto parts = parts_of(surface_of(300));
  std::mt19937 random(3);
  for (int i = 0; i < 2000; ++i) {
    FineSurfaceAssembler assembler;
    for (auto part : parts) {
      auto& bytes = *part.mutable_payload();
      for (int k = 0; k < 3; ++k) bytes[random() % bytes.size()] ^= static_cast<char>(random());
      if (random() % 8 == 0) bytes.resize(1 + random() % bytes.size());
      const auto added = assembler.add(part);
      if (!added.ok() || !*added) continue;
      EXPECT_TRUE(validate(assembler.take()).ok());
    }
  }
}

}  // namespace
}  // namespace trocar::wire
