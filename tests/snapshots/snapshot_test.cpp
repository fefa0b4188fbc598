// The engine reads what it writes: states of random sessions, restored and continued. More of
// them: deploy/campaign snapshots.

#include <gtest/gtest.h>

#include "tests/snapshots/random_session.h"

namespace trocar::testing {
namespace {

SnapshotFigures run(SnapshotScene scene, std::uint64_t seed, std::uint64_t snapshots) {
  RandomSession session(std::move(scene), seed);
  const auto wrong = session.run(snapshots);
  EXPECT_EQ(wrong, "") << "seed " << seed;
  return session.figures();
}

TEST(Snapshots, OfRandomSessionsAreReadAndContinuedBitForBit) {
  SnapshotFigures all;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    all += run(random_scene(SnapshotOrgan::Liver, seed), seed, 20);
    all += run(random_scene(SnapshotOrgan::MeasuredLiver, seed), seed, 5);
  }
  all += run(random_scene(SnapshotOrgan::Plate, 1), 1, 10);
  all += run(random_scene(SnapshotOrgan::Lattice, 1), 1, 10);
  EXPECT_EQ(all.snapshots, 120u);
  EXPECT_GE(all.ticks_continued, 17 * all.snapshots);
  // Each kind of state was among them.
  EXPECT_GT(all.in_a_cut, 0u);
  EXPECT_GT(all.cut, 0u);
  EXPECT_GT(all.self_contact, 0u);
  EXPECT_GT(all.grasp, 0u);
  EXPECT_GT(all.push, 0u);
  EXPECT_GT(all.after_a_tear, 0u);
}

TEST(Snapshots, OfScenariosWithLoadsAreReadAndContinuedBitForBit) {
  SnapshotFigures all;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) all += run(loaded_scene(seed), seed, 15);
  EXPECT_GT(all.cut, 0u);
  EXPECT_GT(all.in_a_cut, 0u);
}

TEST(Snapshots, OfLargeOrgansAreReadAndContinuedBitForBit) {
  run(random_scene(SnapshotOrgan::Stomach, 1), 1, 3);
  run(random_scene(SnapshotOrgan::Chest, 1), 1, 3);
}

}  // namespace
}  // namespace trocar::testing
