// The board with rings to move.

#include <gtest/gtest.h>

#include "server/organs/catalogue/load_organ.h"
#include "server/organs/mesh/pieces.h"

namespace trocar::organ {
namespace {

TEST(Pegs, AreABoardThatIsHeldAndThreeRingsThatAreNot) {
  const auto organ = catalogue::load_organ("pegs");
  ASSERT_TRUE(organ) << organ.error().message;
  EXPECT_TRUE(validate(*organ));
  EXPECT_LT(organ->gravity_m_s2.y, -9);
  const auto pieces = mesh::find_pieces(organ->mesh);
  ASSERT_EQ(pieces.count, 4u);
  std::vector<std::uint8_t> is_fixed(organ->mesh.node_count());
  for (const auto node : organ->fixed_nodes) is_fixed[node.value] = 1;
  std::vector<double> volume(4);
  std::vector<int> held(4);
  for (std::size_t t = 0; t < organ->mesh.tets.size(); ++t) {
    const auto piece = pieces.piece_of_tet[t];
    volume[piece] += mesh::tet_volume(organ->mesh, TetIndex(t));
    for (const auto node : organ->mesh.tets[t]) held[piece] += is_fixed[node.value];
  }
  int boards = 0;
  for (std::size_t piece = 0; piece < 4; ++piece) {
    // 150 x 5 x 90 and six pegs of 6 x 20 x 6; 24 x 10 x 24 without 12 x 10 x 12 mm.
    EXPECT_NEAR(volume[piece], held[piece] > 0 ? 71'820e-9 : 4'320e-9, 1e-12);
    boards += held[piece] > 0;
  }
  EXPECT_EQ(boards, 1);
}

}  // namespace
}  // namespace trocar::organ
