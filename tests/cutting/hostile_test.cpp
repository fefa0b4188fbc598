// Input that no blade gives.

#include <gtest/gtest.h>

#include <limits>

#include "tests/cutting/random_strokes.h"

namespace trocar::cutting::testing {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(HostileBlade, IsRefused) {
  CutOrgan box(box_organ(4, 4, 4, 0.01));
  auto& cutter = box.cutter();
  const Edge good = {{0, -0.03, -0.03}, {0, -0.03, 0.03}};
  EXPECT_FALSE(cutter.move(0, Edge{}));
  EXPECT_FALSE(cutter.move(0, Edge{{0, 0, 0}}));
  EXPECT_FALSE(cutter.move(0, Edge{{0, 0, 0}, {0, 0, 0}}));
  EXPECT_FALSE(cutter.move(0, Edge{{0, 0, 0}, {kNan, 0, 0}}));
  EXPECT_FALSE(cutter.move(0, Edge{{0, kInfinity, 0}, {1, 0, 0}}));
  EXPECT_FALSE(cutter.move(0, Edge{{0, 0, 0}, {1e9, 0, 0}}));
  EXPECT_FALSE(cutter.move(0, Edge(9, Vec3d{0, 0, 0})));
  EXPECT_FALSE(cutter.move(kMaxBlades, good));
  cutter.lift(kMaxBlades);
  cutter.lift(1);
  EXPECT_TRUE(cutter.move(0, good));
  EXPECT_FALSE(cutter.move(0, Edge{{0, kNan, 0}, {0, 0, 0.03}}));
  box.run_until_idle();
  EXPECT_EQ(box.total().splits + box.total().labels, 0u);
  EXPECT_EQ(box.check(), "");
}

TEST(HostileBlade, AJumpCutsNothing) {
  CutOrgan box(box_organ(4, 4, 4, 0.01));
  for (const double x : {-2.0, 2.0, -3.0}) {
    EXPECT_TRUE(box.cutter().move(0, Edge{{x, -0.03, 0}, {x, 0.03, 0}}));
    box.tick();
  }
  box.cutter().lift(0);
  box.run_until_idle();
  EXPECT_EQ(box.total().splits + box.total().labels, 0u);
}

TEST(HostileBlade, AMotionAlongItsOwnEdgeCutsNothing) {
  CutOrgan box(box_organ(4, 4, 4, 0.01));
  box.stroke(straight_path({{0, -0.1, 0}, {0, -0.03, 0}}, {{0, 0, 0}, {0, 0.07, 0}}, 0.001));
  EXPECT_EQ(box.total().splits + box.total().labels, 0u);
}

TEST(HostileBlade, AThousandRandomStrokesBreakNothing) {
  Settings settings;
  settings.edits_per_call = 100;
  CutOrgan box(box_organ(6, 6, 6, 0.01), settings);
  trocar::testing::Random random(3);
  const auto point = [&](double size) {
    return Vec3d{random.between(-size, size), random.between(-size, size),
                 random.between(-size, size)};
  };
  std::uint32_t most = 0;
  for (int stroke = 0; stroke < 1000; ++stroke) {
    const auto blade = random.below(3);
    Edge edge{point(0.03)};
    for (auto i = 1 + random.below(4); i-- > 0;) edge.push_back(edge.back() + point(0.008));
    for (int tick = 0; tick < 2; ++tick) {
      const auto by = point(random.below(8) == 0 ? 0.6 : 0.004);
      for (auto& p : edge) p += by + point(0.001);
      if (random.below(50) == 0) edge[0].x = kNan;
      box.cutter().move(blade, edge);
      const auto before = box.total().splits + box.total().labels;
      box.tick();
      most = std::max(most, box.total().splits + box.total().labels - before);
      if (random.below(50) == 0) edge[0].x = 0;
    }
    if (random.below(2) == 0) box.cutter().lift(blade);
    if (stroke % 100 == 0) {
      ASSERT_EQ(box.check(), "") << stroke;
    }
  }
  for (std::uint32_t blade = 0; blade < 3; ++blade) box.cutter().lift(blade);
  box.run_until_idle();
  EXPECT_EQ(box.check(), "");
  EXPECT_LE(most, 100u + 3 * 64u);  // besides: repairs at the ends of strokes
}

// Four long blades at a metre per second: what they plan is opened later, within some ticks, and no
// more is planned than Settings allow.
TEST(HostileBlade, WorkIsBoundedInACallAndInTheMean) {
  CutOrgan box(box_organ(12, 12, 12, 0.002));
  const Settings settings;
  const int ticks = 400, blades = 4;
  std::uint32_t most = 0, before = 0;
  const auto tick = [&] {
    box.tick();
    const auto edits = box.total().splits + box.total().labels;
    most = std::max(most, edits - before);
    before = edits;
  };
  for (int i = 0; i < ticks; ++i) {
    for (std::uint32_t blade = 0; blade < blades; ++blade) {
      const double x = -0.011 + 0.006 * blade + 1e-5 * i;
      const double y = 0.018 * (i % 40 < 20 ? 0.1 * (i % 20) - 1 : 1 - 0.1 * (i % 20));
      box.cutter().move(blade, Edge{{x, y, -0.02}, {x, y, 0.02}});
    }
    tick();
  }
  const auto all = box.total().splits + box.total().labels;
  EXPECT_GT(all, 500u);
  EXPECT_LE(all, settings.edits_per_call + settings.edits_in_the_mean * ticks);
  EXPECT_LE(most, settings.edits_per_call);
  for (std::uint32_t blade = 0; blade < blades; ++blade) box.cutter().lift(blade);
  int later = 0;
  for (; later < 2000 && !box.cutter().is_idle(); ++later) tick();
  EXPECT_TRUE(box.cutter().is_idle()) << "2 s after they have left";
  EXPECT_EQ(box.check(), "");
}

TEST(HostileEvents, AreRefused) {
  const auto organ = box_organ(3, 3, 3, 0.01);
  CutOrgan box(organ);
  box.stroke(straight_path({{0.003, -0.06, -0.06}, {0.003, -0.06, 0.06}},
                           {{0.003, 0.06, -0.06}, {0.003, 0.06, 0.06}}, 0.01));
  const auto refused = [&](const CutEvents& events) {
    topology::Topology topology(organ);
    Places places(topology);
    const auto status = apply(events, topology, places);
    EXPECT_TRUE(validate(topology).ok());
    return !status.ok();
  };
  const NodeIndex a(0u), b(1u), far(63u), next(64u), none(1000u);
  EXPECT_TRUE(refused({{Split{a, none, 100, next}}, {}}));
  EXPECT_TRUE(refused({{Split{a, a, 100, next}}, {}}));
  EXPECT_TRUE(refused({{Split{a, far, 100, next}}, {}}));
  EXPECT_TRUE(refused({{Split{a, b, 0, next}}, {}}));
  EXPECT_TRUE(refused({{Split{a, b, 100, none}}, {}}));
  EXPECT_FALSE(refused({{Split{a, b, 100, next}}, {}}));
  EXPECT_TRUE(refused({{Open{0, 1}}, {}}));
  EXPECT_TRUE(refused({{Open{0, 1}}, {{TetIndex(9999u), 0}}}));
  EXPECT_TRUE(refused({{Open{0, 1}}, {{TetIndex(0u), 4}}}));
  EXPECT_TRUE(refused({{Open{0, 2}}, {{TetIndex(4u), 0}, {TetIndex(4u), 0}}}));
  EXPECT_TRUE(refused({{Duplicate{a, b}}, {}}));
}

// Each call may make a single edit, and there are two strokes: both still come to their end.
TEST(HostileBlade, StrokesEndHoweverFewEditsACallMayMake) {
  Settings settings;
  settings.edits_per_call = 1;
  CutOrgan box(box_organ(4, 4, 4, 0.01), settings);
  for (int tick = 0; tick <= 100; ++tick) {
    const double y = 0.03 - 0.0006 * tick;
    EXPECT_TRUE(box.cutter().move(0, Edge{{-0.004, y, -0.03}, {-0.004, y, 0.03}}));
    EXPECT_TRUE(box.cutter().move(1, Edge{{-0.03, y, 0.003}, {0.03, y, 0.003}}));
    box.tick();
  }
  box.cutter().lift(0);
  box.cutter().lift(1);
  for (int tick = 0; tick < 5000 && !box.cutter().is_idle(); ++tick) box.tick();
  EXPECT_TRUE(box.cutter().is_idle());
  EXPECT_EQ(box.check(), "");
}

}  // namespace
}  // namespace trocar::cutting::testing
