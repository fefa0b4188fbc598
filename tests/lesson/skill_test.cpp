#include "common/lesson/skill.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

namespace trocar::lesson {
namespace {

constexpr double kDt = 0.016;

Track track_of(
    double seconds, const std::function<Vec3d(double)>& tip,
    const std::function<Vec3d(double)>& force = [](double) { return Vec3d{}; }) {
  Track track;
  for (int i = 0; i * kDt <= seconds + 1e-9; ++i)
    track.samples.push_back({i * kDt, tip(i * kDt), force(i * kDt)});
  return track;
}

// Returns minimum jerk from 0 to 1 (Flash and Hogan 1985).
double minimum_jerk(double s) {
  s = std::clamp(s, 0.0, 1.0);
  return s * s * s * (10 - 15 * s + 6 * s * s);
}

TEST(Skill, PathOfACircle) {
  const double r = 0.03, turn = 2 * std::numbers::pi / 4;
  const auto skill =
      measure_skill(track_of(4,
                             [&](double t) {
                               return Vec3d{r * std::cos(turn * t), r * std::sin(turn * t), 0};
                             }),
                    1);
  EXPECT_NEAR(skill.path_m, 2 * std::numbers::pi * r, 1e-4);
  EXPECT_NEAR(skill.seconds, 4, 1e-6);
  EXPECT_NEAR(skill.economy, 0, 0.01);  // it comes back to where it was
  EXPECT_EQ(skill.idle_s, 0);
  EXPECT_NEAR(skill.working_volume_m3, 0, 1e-12);  // it is flat
}

TEST(Skill, EconomyIsOneForStraightWaysBetweenRests) {
  // There, a rest of a second, and back: as straight as can be.
  const auto tip = [](double t) {
    return Vec3d{0.1 * (minimum_jerk(t / 2) - minimum_jerk((t - 3) / 2)), 0, 0};
  };
  const auto skill = measure_skill(track_of(5, tip), 1);
  EXPECT_NEAR(skill.path_m, 0.2, 1e-6);
  EXPECT_NEAR(skill.economy, 1, 1e-3);
  EXPECT_EQ(skill.movements, 2);
  // At each end of a movement it is slower than 5 mm/s while s (1 - s) < 0.0577: for 0.123 s.
  EXPECT_NEAR(skill.idle_s, 1 + 4 * 0.123, 0.04);
}

TEST(Skill, ForcesTimesAndWork) {
  // Pressed in by 10 mm against 100 N/m, and drawn back: 5 mJ go in, and come back.
  const auto depth = [](double t) { return 0.01 * (1 - std::cos(std::numbers::pi * t)) / 2; };
  const auto skill = measure_skill(track_of(
                                       2,
                                       [&](double t) {
                                         return Vec3d{0, -depth(t), 0};
                                       },
                                       [&](double t) {
                                         return Vec3d{0, 100 * depth(t), 0};
                                       }),
                                   0.5);
  EXPECT_NEAR(skill.peak_n, 1, 1e-3);
  EXPECT_NEAR(skill.work_j, 0.5 * 100 * 0.01 * 0.01, 1e-5);
  EXPECT_NEAR(skill.above_limit_s, 1, 0.05);
}

TEST(Skill, WorkingVolumeOfABox) {
  // Evenly spread over a box: the standard deviation is its length over the root of 12.
  Track track;
  int i = 0;
  for (int x = 0; x < 20; ++x)
    for (int y = 0; y < 20; ++y)
      for (int z = 0; z < 20; ++z)
        track.samples.push_back({kDt * i++, {x * 0.005, y * 0.0025, z * 0.001}, {}});
  const auto sigma = [](double step) { return step * std::sqrt((20.0 * 20 - 1) / 12); };
  EXPECT_NEAR(measure_skill(track, 1).working_volume_m3,
              4.0 / 3 * std::numbers::pi * 8 * sigma(0.005) * sigma(0.0025) * sigma(0.001), 1e-9);
}

TEST(Skill, AGapIsNoWay) {
  auto track = track_of(1, [](double) { return Vec3d{}; });
  for (int i = 0; i < 60; ++i) track.samples.push_back({5 + i * kDt, {1, 0, 0}, {}});
  const auto skill = measure_skill(track, 1);
  EXPECT_EQ(skill.path_m, 0);
  EXPECT_NEAR(skill.seconds, 1 + 59 * kDt, 0.02);
}

// The authors' own implementation gives -1.41403 for this profile.
TEST(Skill, SpectralArcLengthIsThatOfItsAuthors) {
  std::vector<double> speeds;
  for (int i = 0; i < 200; ++i) speeds.push_back(std::exp(-5 * std::pow(-1 + 0.01 * i, 2)));
  EXPECT_NEAR(spectral_arc_length(speeds, 100), -1.41403, 5e-5);
}

// Each further sub-movement adds to the arc.
TEST(Skill, SpectralArcLengthSeesSubmovements) {
  const auto arc_of = [](int bells) {
    std::vector<double> speeds;
    for (int i = 0; i <= 100; ++i) {
      const double s = std::fmod(bells * i / 100.0, 1.0);
      speeds.push_back(30 * s * s * (1 - s) * (1 - s));
    }
    return spectral_arc_length(speeds, 100);
  };
  EXPECT_LT(arc_of(2), arc_of(1) - 0.2);
  EXPECT_LT(arc_of(4), arc_of(2) - 0.2);
  // The scale does not matter.
  std::vector<double> twice;
  for (int i = 0; i <= 100; ++i) twice.push_back(60.0 * i * i * (100 - i) * (100 - i));
  EXPECT_NEAR(spectral_arc_length(twice, 100), arc_of(1), 1e-6);
}

}  // namespace
}  // namespace trocar::lesson
