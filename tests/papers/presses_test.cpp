#include "server/papers/dogan/presses.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "tests/papers/synthetic_reduction.h"

namespace trocar::dogan {
namespace {

const Vec3d& at(const organ::Organ& organ, NodeIndex node) {
  return organ.mesh.rest_positions[node.value];
}

NodeIndex top_centre(const organ::Organ& organ) {
  const auto off = [&](NodeIndex n) {
    return std::abs(at(organ, n).x) + std::abs(at(organ, n).z) - at(organ, n).y;
  };
  return *std::ranges::min_element(organ.mesh.surface_nodes, {}, off);
}

TEST(Presses, TheForceIsEvenlySpreadOverItsPatch) {
  const auto organ = reduction::testing::block(7, 4, 7);
  const auto centre = top_centre(organ);
  const Vec3d force{0.1, -0.4, 0.05};
  const auto forces = node_forces(organ, {centre, force, 0.0101});
  ASSERT_EQ(forces.size(), 5u);  // the node and its neighbours in the plane
  Vec3d sum, moment;
  for (const auto& [node, f] : forces) {
    sum += f;
    moment += cross(at(organ, node) - at(organ, centre), f);
    EXPECT_NEAR(at(organ, node).y, at(organ, centre).y, 1e-12);
    EXPECT_NEAR(length(f), length(force) / 5, 1e-12);  // of equal areas
  }
  EXPECT_LT(length(sum - force), 1e-12);
  EXPECT_LT(length(moment), 1e-12);
  const auto alone = node_forces(organ, {centre, force, 0});
  ASSERT_EQ(alone.size(), 1u);
  EXPECT_EQ(alone[0].node, centre);
}

TEST(Presses, ThinPartsAreNotPressedFromBothSides) {
  const auto organ = reduction::testing::block(7, 4, 7);
  const auto centre = top_centre(organ);
  for (const auto& [node, force] : node_forces(organ, {centre, {0, -1, 0}, 0.2}))
    EXPECT_GT(at(organ, node).y, at(organ, organ.fixed_nodes[0]).y);
}

TEST(Presses, AccessibleNodesAreAwayFromWhatIsHeld) {
  const auto organ = reduction::testing::block(4, 5, 4);
  const double low = at(organ, organ.fixed_nodes[0]).y;
  const auto nodes = accessible_nodes(organ, 0.015);
  EXPECT_EQ(nodes.size(), 12u + 12u + 16u);  // two rings and the top of five layers
  for (const auto node : nodes) EXPECT_GT(at(organ, node).y, low + 0.015);
  // Nothing is that far away: all that can move.
  EXPECT_EQ(accessible_nodes(organ, 0.2).size(), 12u + 12u + 12u + 16u);
}

TEST(Presses, PlacesAreSpreadAndKeepAwayFromThoseTaken) {
  const auto organ = reduction::testing::block(9, 3, 9);
  const auto candidates = accessible_nodes(organ, 0);
  const auto places = spread_nodes(organ, candidates, 8, 3);
  ASSERT_EQ(places.size(), 8u);
  EXPECT_EQ(places[0], candidates[3]);
  const auto nearest = [&](const std::vector<NodeIndex>& nodes) {
    double least = 1;
    for (std::size_t i = 0; i < nodes.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        least = std::min(least, length(at(organ, nodes[i]) - at(organ, nodes[j])));
    return least;
  };
  EXPECT_GT(nearest(places), 0.02);
  auto all = places;
  for (const auto node : spread_nodes(organ, candidates, 6, 3, places)) all.push_back(node);
  EXPECT_GT(nearest(all), 0.0099);
  EXPECT_EQ(spread_nodes(organ, candidates, 10'000, 0).size(), candidates.size());
}

TEST(Presses, DirectionsGoInAndEveryFifthPulls) {
  const Vec3d outward{0, 0.6, 0.8};
  int pulls = 0;
  for (std::size_t first = 0; first < 30; first += 3) {
    const auto directions = press_directions(outward, first, 3, 0.5);
    ASSERT_EQ(directions.size(), 3u);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(length(directions[i]), 1, 1e-12);
      EXPECT_NEAR(std::abs(dot(directions[i], outward)), i == 0 ? 1 : std::cos(0.5), 1e-12);
      pulls += dot(directions[i], outward) > 0 ? 1 : 0;
    }
    EXPECT_GT(length(directions[1] - directions[2]), 0.1);
  }
  EXPECT_EQ(pulls, 6);
}

}  // namespace
}  // namespace trocar::dogan
