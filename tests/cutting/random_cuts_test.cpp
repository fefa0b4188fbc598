// Random cuts of real organs: what has to hold after every one, and how large the wound is.

#include <gtest/gtest.h>

#include "server/organs/catalogue/load_organ.h"
#include "tests/cutting/random_strokes.h"
#include "tests/support/shared.h"

namespace trocar::cutting::testing {
namespace {

organ::Organ load(const char* name) {
  return *catalogue::load_organ((trocar::testing::shared_folder() / "organs" / name).string());
}

void cut_and_check(CutOrgan& organ, int cuts, std::uint64_t seed) {
  RandomStrokes strokes(organ.organ(), organ.cutter().mean_h(), seed);
  for (int cut = 0; cut < cuts; ++cut) {
    organ.stroke(strokes.next(strokes.any_kind()));
    ASSERT_EQ(organ.check(), "") << "cut " << cut;
  }
}

TEST(RandomCuts, OfABox) {
  CutOrgan box(box_organ(6, 6, 6, 0.01));
  cut_and_check(box, 60, 1);
}
TEST(RandomCuts, OfARegularBox) {
  CutOrgan box(box_organ(6, 6, 6, 0.01, 0));
  cut_and_check(box, 60, 2);
}
TEST(RandomCuts, OfASmallLiver) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/liver_tiny.msh");
  CutOrgan liver(load("liver_tiny.msh"));
  cut_and_check(liver, 60, 3);
}
TEST(RandomCuts, OfAGallbladder) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/gallbladder_wall.msh");
  CutOrgan gallbladder(load("gallbladder_wall.msh"));
  cut_and_check(gallbladder, 60, 4);
}

// Edges along wounds are longer where the mesh has grown.
TEST(RandomCuts, AMeshThatHasGrownGrowsSlowerAndIsCutAsMuch) {
  const auto organ = box_organ(12, 12, 12, 0.01);
  const auto cut = [&](const Settings& settings) {
    auto box = std::make_unique<CutOrgan>(organ, settings);
    RandomStrokes strokes(organ, box->cutter().mean_h(), 6);
    for (int stroke = 0; stroke < 40; ++stroke) box->stroke(strokes.next(StrokeKind::Knife));
    EXPECT_EQ(box->check(), "");
    return box;
  };
  Settings even;
  even.growing_length_floor_h = even.grown_length_floor_h = even.length_floor_h;
  const auto staged = cut({}), fine = cut(even);
  const auto uncut = static_cast<double>(organ.mesh.tets.size());
  const auto growth = [&](const CutOrgan& box) {
    return static_cast<double>(box.topology().tet_count()) / uncut - 1;
  };
  EXPECT_LT(growth(*staged), 0.7 * growth(*fine));
  EXPECT_GT(staged->total().opened_area_m2, 0.9 * fine->total().opened_area_m2);
}

TEST(RandomCuts, ThroughCutsLeaveNoBridge) {
  const auto organ = box_organ(8, 8, 8, 0.01);
  const InsideTest inside(organ.mesh);
  RandomStrokes strokes(organ, 0.012, 5);
  double wound = 0, swept = 0;
  for (int cut = 0; cut < 40; ++cut) {
    CutOrgan box(organ);
    const auto path = strokes.next(StrokeKind::Through);
    box.stroke(path);
    ASSERT_EQ(box.check(), "") << cut;
    EXPECT_GE(find_pieces(box.topology()).count, 2u) << cut;
    EXPECT_EQ(box.total().waiting_area_m2, 0) << cut;
    wound += box.total().opened_area_m2;
    swept += inside.swept_area(path, 0.001);
  }
  EXPECT_NEAR(wound, swept, 0.03 * swept);
}

// The rim of a wound is rough by a share of h, so single ones are within 10 % only if they have at
// least 3 h of area per perimeter.
TEST(RandomCuts, WoundsOfAKnifeAreAsLargeAsItsPath) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/liver_coarse.msh");
  const auto organ = load("liver_coarse.msh");
  const InsideTest inside(organ.mesh);
  double wound = 0, swept = 0;
  const double h = CutOrgan(organ).cutter().mean_h();
  RandomStrokes strokes(organ, h, 6);
  for (int cut = 0; cut < 30; ++cut) {
    CutOrgan liver(organ);
    const auto path = strokes.next(StrokeKind::Knife);
    liver.stroke(path);
    ASSERT_EQ(liver.check(), "") << cut;
    wound += liver.total().opened_area_m2;
    swept += inside.swept_area(path, h / 8);
  }
  EXPECT_NEAR(wound, swept, 0.05 * swept);
}

TEST(RandomCuts, SameSeedSameTopology) {
  std::uint64_t hashes[2];
  for (auto& hash : hashes) {
    CutOrgan box(box_organ(5, 5, 5, 0.01));
    cut_and_check(box, 15, 7);
    hash = topology_hash(box.topology());
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

}  // namespace
}  // namespace trocar::cutting::testing
