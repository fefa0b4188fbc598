// The set of nodes that are swept most: pressed ones, the queue, and what has left these.

#include "server/tissue/propagation/active_set.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "server/organs/catalogue/builtin_organs.h"

namespace trocar::propagation {
namespace {

using Nodes = std::vector<NodeIndex>;

class LatticeSet : public ::testing::Test {
 protected:
  LatticeSet()
      : organ(catalogue::make_lattice()),
        world(organ),
        queue(organ.mesh.node_count()),
        active(organ.mesh.node_count()) {
    for (std::size_t i = 0; i < organ.mesh.node_count(); ++i)
      if (world.node_classes[i] != world::NodeClass::Fixed) free.push_back(NodeIndex(i));
  }

  Nodes collect(const Nodes& touched, const Nodes& pressed) {
    const std::vector<std::span<const NodeIndex>> seeds{touched};
    queue.fill(organ.mesh.node_neighbours, seeds, {1, 1'000'000});
    active.collect(queue, pressed, world::Boundary::Graded, world);
    return {active.nodes().begin(), active.nodes().end()};
  }
  void settle(std::uint32_t linger_ticks) {
    const std::vector<float> residuals(active.nodes().size());
    active.settle(queue, residuals, linger_ticks, world);
  }

  organ::Organ organ;
  world::World world;
  PropagationQueue queue;
  ActiveSet active;
  Nodes free;
};

TEST_F(LatticeSet, WhatTissuePressesIsSweptFirstAndAlone) {
  const NodeIndex touched = free.front(), far = free.back();
  const auto queued = collect({touched}, {});
  ASSERT_GT(queued.size(), 2u);
  EXPECT_EQ(active.pressed_count(), 0u);
  const NodeIndex beside = queued.back();
  ASSERT_EQ(std::ranges::count(queued, far), 0);

  const auto nodes = collect({touched}, {beside, far});
  EXPECT_EQ(active.pressed_count(), 2u);
  EXPECT_EQ(nodes.size(), queued.size() + 1) << "each node once, and none around a pressed one";
  EXPECT_EQ(nodes[0], beside);
  EXPECT_EQ(nodes[1], far);
  EXPECT_TRUE(std::equal(nodes.begin() + 2, nodes.end(), queued.begin()));
}

TEST_F(LatticeSet, WhatIsPressedNoMoreLingers) {
  const NodeIndex far = free.back();
  constexpr std::uint32_t kLinger = 3;
  for (int i = 0; i < 5; ++i) {
    ASSERT_EQ(collect({}, {far}), Nodes{far});
    settle(kLinger);
  }
  for (std::uint32_t i = 0; i < kLinger; ++i) {
    ASSERT_EQ(collect({}, {}), Nodes{far}) << "tick " << i;
    EXPECT_EQ(active.pressed_count(), 0u);
    settle(kLinger);
  }
  EXPECT_TRUE(collect({}, {}).empty());
}

TEST_F(LatticeSet, FixedNodesArePressedInVain) {
  ASSERT_FALSE(organ.fixed_nodes.empty());
  EXPECT_TRUE(collect({}, {organ.fixed_nodes.front()}).empty());
  EXPECT_EQ(active.pressed_count(), 0u);
}

}  // namespace
}  // namespace trocar::propagation
