// Looking only at what is near the blades: the same edits as looking at everything, and work that
// does not grow with the organ.

#include <gtest/gtest.h>

#include <cmath>

#include "server/organs/catalogue/load_organ.h"
#include "tests/cutting/random_strokes.h"
#include "tests/support/shared.h"

namespace trocar::cutting::testing {
namespace {

// One cutter is told how far nodes have moved, the other is not. Tissue sways, now and then jumps,
// and parts of it drift away.
void cut_twice(const organ::Organ& organ, int strokes, std::uint64_t seed) {
  CutOrgan local(organ), full(organ);
  const double h = local.cutter().mean_h();
  RandomStrokes random_strokes(organ, h, seed);
  auto& random = random_strokes.random();
  double phase = 0;
  local.travel_m = 0;
  const auto move_tissue = [&] {
    phase += random.below(100) == 0 ? 2 : 0.01;
    local.displacements.resize(local.topology().node_count());
    float farthest = 0;
    for (std::size_t n = 0; n < local.displacements.size(); ++n) {
      const auto& p = local.topology().rest()[n];
      const double away = p.x > 0 ? 0.3 * phase : 0;
      const auto now =
          to_float(Vec3d{std::sin(phase + 30 * p.y) + away, std::cos(phase + 20 * p.x), 0} * h);
      farthest = std::max(farthest, length(now - local.displacements[n]));
      local.displacements[n] = now;
    }
    local.travel_m += static_cast<double>(farthest);
    full.displacements = local.displacements;
  };
  for (int stroke = 0; stroke < strokes; ++stroke) {
    const auto path = random_strokes.next(random_strokes.any_kind());
    const Vec3d by{std::sin(phase) * h, std::cos(phase) * h, 0};
    for (std::size_t i = 0; i <= path.size() || !local.cutter().is_idle(); ++i) {
      move_tissue();
      for (auto* const each : {&local, &full}) {
        if (i < path.size()) {
          auto edge = path[i];
          for (auto& p : edge) p += by;
          each->cutter().move(0, edge);
        } else {
          each->cutter().lift(0);
        }
        each->tick();
      }
      ASSERT_EQ(local.last().events, full.last().events) << "stroke " << stroke << ", tick " << i;
    }
    ASSERT_EQ(local.check(), "") << stroke;
  }
  EXPECT_GT(local.total().splits, 100u);
}

TEST(LocalCost, SameEditsInABox) {
  for (const std::uint64_t seed : {1, 2, 3}) cut_twice(box_organ(10, 10, 10, 0.01), 12, seed);
}
TEST(LocalCost, SameEditsInALiver) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/liver_coarse.msh");
  const auto path = trocar::testing::shared_folder() / "organs/liver_coarse.msh";
  cut_twice(*catalogue::load_organ(path.string()), 10, 4);
}
TEST(LocalCost, SameEditsInAGallbladder) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/gallbladder_wall.msh");
  const auto path = trocar::testing::shared_folder() / "organs/gallbladder_wall.msh";
  cut_twice(*catalogue::load_organ(path.string()), 15, 5);
}

TEST(NodeBundles, LooksAtFewNodesWhereverTheyMove) {
  trocar::testing::Random random(1);
  std::vector<Vec3d> places;
  for (int n = 0; n < 20'000; ++n)
    places.push_back({random.between(0, 1), random.between(0, 1), random.between(0, 1)});
  NodeBundles bundles(places, std::vector<double>(places.size()));
  const auto anywhere = [](const Vec3d&, double, double) { return true; };
  double travel = 0;
  for (int round = 0; round < 50; ++round) {
    if (round > 0) {
      const Vec3d drift{random.between(0, 0.002), 0, random.between(0, 0.002)};
      for (auto& p : places) p += drift;
      travel += length(drift);
    }
    // One more, at the place of its parent or far from it.
    const NodeIndex parent(random.below(20'000)), made(places.size());
    places.push_back(places[parent.value] + Vec3d{0, round % 2 * 0.3, 0});
    std::size_t looks = 0;
    const auto place = [&](NodeIndex n) { return ++looks, places[n.value]; };
    bundles.add(made, parent, 0, travel, place);
    looks = 0;
    Box box;
    const auto centre = places[random.below(20'000)];
    box.include(centre - Vec3d{0.05, 0.05, 0.05});
    box.include(centre + Vec3d{0.05, 0.05, 0.05});
    std::vector<NodeIndex> found, expected;
    bundles.collect(box, travel, place, anywhere, found);
    std::ranges::sort(found);
    for (std::size_t n = 0; n < places.size(); ++n)
      if (box.contains(places[n])) expected.emplace_back(n);
    ASSERT_EQ(found, expected) << round;
    if (round > 0) {
      EXPECT_LT(looks, 4000u) << round;
    }
  }
}

}  // namespace
}  // namespace trocar::cutting::testing
