// Lengths on the organ: places move with the tissue, and a cut or a seek does not lose them.

#include "client/replica/measured_places.h"

#include <gtest/gtest.h>

#include "tests/client/square.h"

namespace trocar::replica {
namespace {

// Measures from the corner 0 to the middle of the edge from 1 to 2.
MeasuredPlaces measured(const Topology& topology) {
  MeasuredPlaces places;
  places.add(0, {0, 0}, topology);
  places.add(0, {0.5f, 0.5f}, topology);
  return places;
}

TEST(MeasuredPlaces, TheLineIsStraightAndMovesWithTheTissue) {
  const auto topology = square();
  auto places = measured(topology);
  EXPECT_FALSE(places.distance_m()) << "nobody has said where the tissue is";
  places.update(topology, 1, topology.rest_positions);
  EXPECT_NEAR(places.distance_m().value(), std::hypot(0.01f, 0.005f), 1e-7f);
  auto moved = topology.rest_positions;
  moved[0] = {0, 0, 0.02f};  // lifted by 20 mm
  places.update(topology, 1, moved);
  EXPECT_NEAR(places.distance_m().value(), std::hypot(0.01f, 0.005f, 0.02f), 1e-7f);
}

TEST(MeasuredPlaces, AThirdPlaceBeginsAnew) {
  const auto topology = square();
  auto places = measured(topology);
  places.add(1, {0, 1}, topology);
  EXPECT_EQ(places.count(), 1u);
  places.update(topology, 1, topology.rest_positions);
  EXPECT_FALSE(places.distance_m());
  places.clear();
  EXPECT_EQ(places.count(), 0u);
}

TEST(MeasuredPlaces, APlaceThatNoTriangleHasIsNotTaken) {
  const auto topology = square();
  MeasuredPlaces places;
  places.add(2, {0, 0}, topology);
  EXPECT_EQ(places.count(), 0u);
}

TEST(MeasuredPlaces, ACutGivesThePlaceToAnotherTriangleThatHasItAtRest) {
  auto topology = square();
  auto places = measured(topology);
  // The first triangle is split in two at the middle of its diagonal.
  topology.rest_positions.push_back({0.005f, 0.005f, 0});
  topology.triangles = {{}, {0, 2, 3}, {0, 1, 4}, {1, 2, 4}};
  topology.is_wound = {0, 0, 0, 0};
  places.update(topology, 2, topology.rest_positions);
  EXPECT_NEAR(places.distance_m().value(), std::hypot(0.01f, 0.005f), 1e-6f);
}

TEST(MeasuredPlaces, AnotherTriangleOfTheSameNumberIsNotTakenForIt) {
  auto topology = square();
  auto places = measured(topology);
  std::swap(topology.triangles[0], topology.triangles[1]);
  places.update(topology, 2, topology.rest_positions);
  EXPECT_NEAR(places.distance_m().value(), std::hypot(0.01f, 0.005f), 1e-6f);
}

TEST(MeasuredPlaces, WhereTissueIsGoneAPlaceIsLostUntilItIsThereAgain) {
  const auto whole = square();
  auto places = measured(whole);
  auto taken = whole;
  for (auto& corner : taken.rest_positions) corner.x += 0.1f;
  places.update(taken, 2, taken.rest_positions);
  ASSERT_EQ(places.positions().size(), 2u);
  EXPECT_FALSE(places.positions()[0]);
  EXPECT_FALSE(places.distance_m());
  places.update(whole, 3, whole.rest_positions);
  EXPECT_TRUE(places.distance_m());
}

TEST(MeasuredPlaces, APlaceInAWoundStaysInAWound) {
  auto topology = square();
  topology.is_wound = {1, 0};
  MeasuredPlaces places;
  places.add(0, {0.25f, 0.25f}, topology);
  topology.is_wound = {0, 0};  // a time before the cut
  places.update(topology, 2, topology.rest_positions);
  EXPECT_FALSE(places.positions()[0]);
}

}  // namespace
}  // namespace trocar::replica
