// One tet: which sub-tets a clean crossing makes, two blades, sawing.

#include <gtest/gtest.h>

#include "tests/cutting/cut_organ.h"

namespace trocar::cutting::testing {
namespace {

// Nothing refused, nothing snapped, chips allowed.
Settings exact() {
  Settings settings;
  settings.snap = 0.01;
  settings.length_floor_h = 0.01;
  settings.floor_sine = 0.001;
  settings.debris_tets = 0;
  settings.debris_volume_h3 = 0;
  settings.whole_volume_h3 = 0;
  return settings;
}

std::size_t tets(const CutOrgan& organ) {
  return find_pieces(organ.topology()).piece_of_tet.size();
}

// Returns a wide sweep through `at`: the blade's edge lies along `edge` and moves along `motion`.
Path plane_sweep(const Vec3d& at, const Vec3d& edge, const Vec3d& motion, double step_m = 0.01) {
  const Vec3d e = normalized(edge, {}) * 0.3, m = normalized(motion, {}) * 0.3;
  return straight_path({at - e - m, at + e - m}, {at - e + m, at + e + m}, step_m);
}

TEST(SingleTet, OneCornerOffMakesFourTets) {
  CutOrgan tet(tet_organ(), exact());
  // Corner 0 is at (1, 1, 1): a plane across that direction.
  tet.stroke(plane_sweep({0.02, 0.02, 0.02}, {1, -1, 0}, {1, 1, -2}));
  EXPECT_EQ(tet.check(), "");
  EXPECT_EQ(tets(tet), 4u);
  EXPECT_EQ(tet.total().splits, 3u);
  const auto pieces = find_pieces(tet.topology());
  EXPECT_EQ(pieces.tets, (std::vector<std::uint32_t>{1, 3}));
}

TEST(SingleTet, TwoAndTwoCornersMakeSixTets) {
  CutOrgan tet(tet_organ(), exact());
  tet.stroke(plane_sweep({0.004, 0, 0}, {0, 1, 0.1}, {0, -0.1, 1}));
  EXPECT_EQ(tet.check(), "");
  EXPECT_EQ(tets(tet), 6u);
  EXPECT_EQ(tet.total().splits, 4u);
  EXPECT_EQ(find_pieces(tet.topology()).tets, (std::vector<std::uint32_t>{3, 3}));
}

TEST(SingleTet, AThroughACornerMakesThreeTets) {
  CutOrgan tet(tet_organ(), exact());
  // Through corner 0 and between corner 1 and the two others.
  const Vec3d corner{0.05, 0.05, 0.05}, inside{-0.01, -0.01, 0.02};
  tet.stroke(plane_sweep(inside, corner - inside, cross(corner - inside, Vec3d{1, 1.2, -1})));
  EXPECT_EQ(tet.check(), "");
  EXPECT_EQ(find_pieces(tet.topology()).count, 2u);
  EXPECT_EQ(tets(tet), 3u);
}

TEST(SingleTet, ATinyChipStaysWithTheOtherSide) {
  CutOrgan tet(tet_organ());
  tet.stroke(plane_sweep({0.02, 0.02, 0.02}, {1, -1, 0}, {1, 1, -2}));
  EXPECT_EQ(tet.check(), "");
  EXPECT_EQ(find_pieces(tet.topology()).count, 1u);
}

TEST(SingleTet, TwoBladesAtOnce) {
  auto settings = exact();
  settings.length_floor_h = 0.05;
  CutOrgan tet(tet_organ(), settings);
  const auto a = plane_sweep({0.004, 0, 0}, {0, 1, 0.1}, {0, -0.1, 1}, 0.003);
  const auto b = plane_sweep({0, 0.006, 0}, {1, 0, 0.1}, {-0.1, 0, 1}, 0.003);
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_TRUE(tet.cutter().move(0, a[i]));
    EXPECT_TRUE(tet.cutter().move(1, b[i]));
    tet.tick();
    ASSERT_EQ(tet.check(), "");
  }
  tet.cutter().lift(1);
  tet.cutter().lift(0);
  tet.run_until_idle();
  EXPECT_EQ(tet.check(), "");
  EXPECT_EQ(find_pieces(tet.topology()).count, 4u);
}

TEST(SingleTet, SawingDoesNotGoOnAddingTets) {
  // 1 mm to and fro at 5 Hz, with a noise of 0.05 mm across, inside one tet of a box.
  CutOrgan box(box_organ(4, 4, 4, 0.01));
  trocar::testing::Random random(7);
  std::uint32_t soon = 0;
  for (int tick = 0; tick < 10'000; ++tick) {
    const int phase = tick % 200;
    const double along = (phase < 100 ? phase : 200 - phase) * 1e-5 - 0.0005;
    const double aside = random.between(-5e-5, 5e-5);
    const Edge edge = {{0.003 + along, 0.002 + aside, -0.02}, {0.003 + along, 0.002 + aside, 0.02}};
    ASSERT_TRUE(box.cutter().move(0, edge));
    box.tick();
    if (tick == 999) soon = box.total().splits;
  }
  box.cutter().lift(0);
  box.run_until_idle();
  EXPECT_EQ(box.check(), "");
  // Besides: repairs when the blade has gone.
  EXPECT_LE(box.total().splits - box.total().pinch_splits, soon + 8);
  EXPECT_LE(box.total().splits, 60u);
}

}  // namespace
}  // namespace trocar::cutting::testing
