// Tests what a fill costs, in neighbour lists read: nothing when nothing changed, and otherwise a
// multiple of the nodes that changed, not of the region.

#include <gtest/gtest.h>

#include <algorithm>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/propagation/queue.h"

namespace trocar::propagation {
namespace {

constexpr catalogue::LatticeSize kSize;

class QueueWork : public ::testing::Test {
 protected:
  QueueWork() : organ(catalogue::make_lattice()), queue(organ.mesh.node_count()) {}

  // Top nodes with i in [i_begin, i_end) and k in [k_begin, k_end).
  static std::vector<NodeIndex> patch(int i_begin, int i_end, int k_begin, int k_end) {
    std::vector<NodeIndex> out;
    for (int k = k_begin; k < k_end; ++k)
      for (int i = i_begin; i < i_end; ++i) out.push_back(lattice_node(kSize, i, kSize.ny - 1, k));
    return out;
  }
  // Returns how many nodes have another layer than before.
  std::size_t fill(const std::vector<std::vector<NodeIndex>>& contacts, QueueLimits limits) {
    std::vector<std::uint32_t> before(organ.mesh.node_count());
    for (std::size_t i = 0; i < before.size(); ++i) before[i] = queue.layer_of(NodeIndex(i));
    const std::vector<std::span<const NodeIndex>> seeds(contacts.begin(), contacts.end());
    queue.fill(organ.mesh.node_neighbours, seeds, limits);
    std::size_t changed = 0;
    for (std::size_t i = 0; i < before.size(); ++i)
      changed += before[i] != queue.layer_of(NodeIndex(i)) ? 1 : 0;
    return changed;
  }

  organ::Organ organ;
  PropagationQueue queue;
};

TEST_F(QueueWork, IsNoneWhenNothingChanged) {
  const std::vector contacts{patch(4, 9, 4, 9), patch(18, 22, 18, 22)};
  fill(contacts, {6, 1200});
  EXPECT_GT(queue.nodes_visited(), 0u);
  const std::vector<NodeIndex> nodes(queue.nodes().begin(), queue.nodes().end());
  EXPECT_EQ(fill(contacts, {6, 1200}), 0u);
  EXPECT_EQ(queue.nodes_visited(), 0u);
  EXPECT_TRUE(std::equal(nodes.begin(), nodes.end(), queue.nodes().begin(), queue.nodes().end()));
  // The same nodes in another order are no change either.
  std::vector reversed = contacts;
  std::reverse(reversed[0].begin(), reversed[0].end());
  fill(reversed, {6, 1200});
  EXPECT_EQ(queue.nodes_visited(), 0u);
}

TEST_F(QueueWork, OfASurfaceNodeThatJoinsOrLeavesIsFarBelowTheRegion) {
  auto contact = patch(10, 18, 10, 18);
  fill({contact}, {10, 1'000'000});
  const std::size_t region = queue.nodes().size();
  ASSERT_GT(region, 3000u);
  // One node joins the contact beside the middle of its edge, and leaves it again.
  contact.push_back(lattice_node(kSize, 18, kSize.ny - 1, 14));
  EXPECT_GT(fill({contact}, {10, 1'000'000}), 0u);
  EXPECT_LT(queue.nodes_visited(), region / 10);
  contact.pop_back();
  EXPECT_GT(fill({contact}, {10, 1'000'000}), 0u);
  EXPECT_LT(queue.nodes_visited(), region / 5);
}

TEST_F(QueueWork, OfAContactThatMovesDoesNotDependOnARestingOne) {
  const QueueLimits limits{5, 1'000'000};
  const auto before = patch(24, 26, 24, 26), after = patch(23, 25, 24, 26);
  std::vector<std::size_t> moved, vanished, appeared, regions;
  for (const int size : {14, 18}) {
    const auto resting = patch(0, size, 0, size);
    fill({before, resting}, limits);
    regions.push_back(queue.nodes().size());
    fill({after, resting}, limits);
    EXPECT_EQ(queue.region_count(), 2);
    moved.push_back(queue.nodes_visited());
    fill({{}, resting}, limits);
    vanished.push_back(queue.nodes_visited());
    fill({before, resting}, limits);
    appeared.push_back(queue.nodes_visited());
  }
  EXPECT_GT(regions[1], regions[0] + 400);
  EXPECT_GT(moved[0], 0u);
  EXPECT_EQ(moved[0], moved[1]);
  EXPECT_EQ(vanished[0], vanished[1]);
  EXPECT_EQ(appeared[0], appeared[1]);
}

TEST_F(QueueWork, GoesWithTheNodesThatChange) {
  // A patch slides over the top, a node of its rim at a time: in front one joins, behind one
  // leaves.
  auto contact = patch(3, 9, 8, 14);
  fill({contact}, {8, 1'000'000});
  for (int i = 9; i < 26; ++i)
    for (int k = 8; k < 14; ++k) {
      contact.push_back(lattice_node(kSize, i, kSize.ny - 1, k));
      const std::size_t joined = fill({contact}, {8, 1'000'000});
      EXPECT_LE(queue.nodes_visited(), joined) << i << " " << k;
      contact.erase(contact.begin());
      const std::size_t left = fill({contact}, {8, 1'000'000});
      // A node that falls back is read once as its support goes, once for what is left of it and
      // once as it settles; and its neighbours may be asked for their support, of six at most four.
      EXPECT_LE(queue.nodes_visited(), 7 * left) << i << " " << k;
    }
}

}  // namespace
}  // namespace trocar::propagation
