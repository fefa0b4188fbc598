// The two bodies of Nakao's large case.

#include <gtest/gtest.h>

#include <algorithm>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/mesh/pieces.h"

namespace trocar::organ {
namespace {

const Organ& chest() {
  static const Organ organ = *catalogue::load_organ("chest");
  return organ;
}

TEST(Chest, IsOfThePapersSize) {
  const auto& mesh = chest().mesh;
  EXPECT_TRUE(validate(chest()));
  EXPECT_NEAR(static_cast<double>(mesh.node_count()), 17'582, 0.01 * 17'582);
  EXPECT_NEAR(static_cast<double>(mesh.tets.size()), 73'279, 0.01 * 73'279);
  EXPECT_NEAR(static_cast<double>(mesh.edges.size()), 100'807, 0.06 * 100'807);
  const auto angles = mesh::dihedral_range(mesh);
  EXPECT_GT(angles.min_deg, 12);
  EXPECT_LT(angles.max_deg, 156);
}

TEST(Chest, IsAWallAndAHeartUnderItThatDoNotTouch) {
  const auto& mesh = chest().mesh;
  const auto pieces = mesh::find_pieces(mesh);
  ASSERT_EQ(pieces.count, 2u);
  ASSERT_EQ(chest().regions.size(), 1u);
  const auto& heart = chest().regions[0];
  EXPECT_EQ(heart.name, "heart");
  std::vector<std::uint8_t> is_heart(mesh.node_count());
  for (const auto node : heart.nodes) is_heart[node.value] = 1;
  double bottom = 1, top = -1;
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    const double y = mesh.rest_positions[n].y;
    is_heart[n] != 0 ? top = std::max(top, y) : bottom = std::min(bottom, y);
  }
  EXPECT_NEAR(bottom - top, 0.004, 1e-9);
  // Every tet is wholly of one body.
  std::size_t hearts = 0;
  for (const auto& tet : mesh.tets) {
    const auto count = std::ranges::count_if(tet, [&](NodeIndex n) { return is_heart[n.value]; });
    ASSERT_TRUE(count == 0 || count == 4);
    hearts += count == 4;
  }
  EXPECT_GT(hearts, 12'000u);
}

TEST(Chest, IsUnderTensionWhereItIsHeldAtItsRim) {
  EXPECT_EQ(chest().material.tension, 0.04);
  EXPECT_EQ(chest().regions[0].material.tension, 0);
  const auto map = material_map(chest());
  std::size_t held[2] = {0, 0};
  for (const auto node : chest().fixed_nodes) ++held[map.nodes[node.value]];
  EXPECT_EQ(held[0], 2u * (51 + 39) * 7);
  EXPECT_GT(held[1], 50u);
  EXPECT_EQ(organ_hash(chest()), organ_hash(catalogue::make_chest()));
}

}  // namespace
}  // namespace trocar::organ
