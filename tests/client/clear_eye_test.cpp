// Nobody looks out of tissue: an eye that flies through a cut organ at random is always outside,
// and the near plane cuts no wall away.

#include "client/shape/clear_eye.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "client/render/camera.h"
#include "tests/client/cut_liver.h"
#include "tests/support/random.h"

namespace trocar::shape {
namespace {

constexpr int kPlaces = 10'000;

struct Seen {
  float winding = 0;      // how often the surface winds around a place, by its solid angles
  float nearest_m = 1e9;  // to the corners of the triangles
};

// Solid angles by Van Oosterom and Strackee 1983.
Seen look_from(const Vec3f& eye, std::span<const Vec3f> positions,
               std::span<const TriangleCorners> triangles) {
  Seen seen;
  double sum = 0;
  for (const auto& t : triangles) {
    if (t[0] == t[1]) continue;
    const Vec3f a = positions[t[0]] - eye, b = positions[t[1]] - eye, c = positions[t[2]] - eye;
    const float la = length(a), lb = length(b), lc = length(c);
    seen.nearest_m = std::min({seen.nearest_m, la, lb, lc});
    sum += std::atan2(dot(a, cross(b, c)),
                      la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
  }
  seen.winding = static_cast<float>(sum / (2 * std::numbers::pi));
  return seen;
}

Vec3f random_place(testing::Random& random, float most) {
  const auto one = [&] { return static_cast<float>(random.between(-most, most)); };
  return {one(), one(), one()};
}

Vec3f random_direction(testing::Random& random) {
  for (;;) {
    const Vec3f d = random_place(random, 1);
    if (length(d) > 0.1f && length(d) < 1) return normalized(d, d);
  }
}

TEST(ClearEye, FliesThroughACutLiverAndIsNeverInIt) {
  const auto& cut = testing::cut_liver();
  SmoothSurface drawn;
  drawn.build(cut.positions.size(), cut.triangles, cut.layout.is_wound, 24'000);
  drawn.smooth_borders(cut.rest);
  drawn.update(cut.positions);
  std::vector<Vec3f> wounds;  // in which a person looks around most
  for (std::size_t i = 0; i < cut.triangles.size(); ++i)
    if (cut.layout.is_wound[i] != 0) wounds.push_back(cut.positions[cut.triangles[i][0]]);
  testing::Random random(5);
  int were_inside = 0, stay = 0;
  for (int i = 0; i < kPlaces; ++i) {
    const auto wound = random.below(static_cast<std::uint32_t>(wounds.size()));
    const Vec3f eye =
        i % 2 == 0 ? random_place(random, 0.12f) : wounds[wound] + random_place(random, 0.01f);
    const Vec3f forward = random_direction(random);
    const float wanted = i % 3 == 0 ? kScopeClearMetres : kClearMetres;
    const ClearEye clear = clear_eye(eye, forward, cut.positions, cut.triangles, wanted);
    ASSERT_GE(clear.back_m, 0);
    if (clear.back_m == 0) {
      ++stay;
    } else {
      were_inside += look_from(eye, cut.positions, cut.triangles).winding > 0.5f;
    }
    const Vec3f place = eye - forward * clear.back_m;
    const Seen seen = look_from(place, cut.positions, cut.triangles);
    ASSERT_LT(seen.winding, 0.5f) << "at place " << i << " tissue is around the eye";
    ASSERT_GE(clear.nearest_m, wanted);
    ASSERT_GE(seen.nearest_m * 1.0001f, clear.nearest_m) << i;
    // The surface that is drawn is rounder than the one that was sent.
    if (i % 50 == 0) {
      ASSERT_LT(look_from(place, drawn.positions(), drawn.triangles()).winding, 0.5f) << i;
    }
  }
  EXPECT_GT(were_inside, kPlaces / 20);
  EXPECT_GT(stay, kPlaces / 20);
}

TEST(ClearEye, StaysWhereItIsClear) {
  const auto& cut = testing::cut_liver();
  const ClearEye clear =
      clear_eye({0, 0, 1}, {0, 0, -1}, cut.positions, cut.triangles, kClearMetres);
  EXPECT_EQ(clear.back_m, 0);
  EXPECT_EQ(clear.nearest_m, kLookMetres);
}

TEST(ClearEye, ANearPlaneReachesToNoCornerBeyondTheNearest) {
  const float near = near_plane(0.002f, 0.7f, 16.0f / 9);
  const Vec3f corner{0.7f * near * 16 / 9, 0.7f * near, near};
  EXPECT_NEAR(length(corner), 0.002f, 1e-6f);
}

TEST(ClearEye, ACameraInAWallShowsWhatIsBeforeIt) {
  const auto& cut = testing::cut_liver();
  render::OrbitCamera camera;
  constexpr render::Size kSize{1280, 720};
  Lens lens{.eye = {0, 0, 0.02f}, .forward = {0, 0, -1}, .up = {0, 1, 0}, .tan_half_height = 0.7f};
  camera.look_through(lens);
  const Vec3f before = camera.rays(kSize).eye;
  camera.keep_clear(cut.positions, cut.triangles, kSize);
  const Vec3f eye = camera.rays(kSize).eye;
  EXPECT_GT(eye.z, before.z + 0.005f);
  // The way back is along the view, so the same place stays in the middle.
  EXPECT_NEAR(eye.x, before.x, 1e-6f);
  EXPECT_LT(look_from(eye, cut.positions, cut.triangles).winding, 0.5f);
  // A wall that is as near as it may be is drawn, and not cut away.
  EXPECT_TRUE(camera.project(eye - Vec3f{0, 0, kScopeClearMetres}, kSize));
}

}  // namespace
}  // namespace trocar::shape
