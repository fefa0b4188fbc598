// Node counts of the layered queue against Choi 2002 eq. 2 and its interior counterpart.

#include <gtest/gtest.h>

#include <set>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/propagation/queue.h"

namespace trocar::propagation {
namespace {

class LatticeQueue : public ::testing::Test {
 protected:
  LatticeQueue() : organ(catalogue::make_lattice()), queue(organ.mesh.node_count()) {}

  NodeIndex nearest(Vec3d place) const {
    std::size_t best = 0;
    for (std::size_t i = 0; i < organ.mesh.node_count(); ++i)
      if (length_squared(organ.mesh.rest_positions[i] - place) <
          length_squared(organ.mesh.rest_positions[best] - place))
        best = i;
    return NodeIndex(best);
  }
  std::size_t reached(NodeIndex seed, std::uint32_t depth) {
    const std::vector<NodeIndex> contact{seed};
    const std::vector<std::span<const NodeIndex>> seeds{contact};
    queue.fill(organ.mesh.node_neighbours, seeds, {depth, 1'000'000});
    EXPECT_EQ(std::set(queue.nodes().begin(), queue.nodes().end()).size(), queue.nodes().size())
        << "each node enters once";
    return queue.nodes().size();
  }

  organ::Organ organ;
  PropagationQueue queue;
};

TEST_F(LatticeQueue, SurfaceCountsFollowChoiEquation2) {
  const auto top = nearest({0, 1, 0});
  for (std::uint32_t n = 0; n <= 12; ++n)
    EXPECT_EQ(reached(top, n), (n + 1) * (2 * n * n + 4 * n + 3) / 3) << "depth " << n;
}

TEST_F(LatticeQueue, InteriorCountsFollowTheUnboundedLattice) {
  const auto middle = nearest({0, 0, 0});
  for (std::uint32_t n = 0; n <= 7; ++n)
    EXPECT_EQ(reached(middle, n), (2 * n + 1) * (2 * n * n + 2 * n + 3) / 3) << "depth " << n;
}

TEST_F(LatticeQueue, ANodeLimitInsideALayerTreatsContactsAlike) {
  const std::vector<NodeIndex> left{nearest({-0.07, 1, 0})}, right{nearest({0.07, 1, 0})};
  const std::vector<std::span<const NodeIndex>> seeds{left, right};
  for (const std::uint32_t limit : {1u, 2u, 3u, 7u, 20u, 33u, 101u}) {
    queue.fill(organ.mesh.node_neighbours, seeds, {10, limit});
    ASSERT_EQ(queue.nodes().size(), limit);
    std::size_t of_left = 0;
    for (const auto node : queue.nodes()) of_left += queue.region(node) == 1 ? 1 : 0;
    EXPECT_EQ(of_left, (limit + 1) / 2);
  }
}

TEST_F(LatticeQueue, NoContactLeavesAnEmptyQueue) {
  queue.fill(organ.mesh.node_neighbours, {}, {6, 1200});
  EXPECT_TRUE(queue.nodes().empty());
  EXPECT_EQ(queue.region_count(), 0);
}

}  // namespace
}  // namespace trocar::propagation
