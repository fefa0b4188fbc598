// A blade straight through.

#include <gtest/gtest.h>

#include "tests/cutting/cut_organ.h"

namespace trocar::cutting::testing {
namespace {

TEST(StraightCut, PartsABoxInTwo) {
  CutOrgan box(box_organ(8, 8, 8, 0.01));
  const Edge from = {{0.003, -0.06, -0.06}, {0.003, -0.06, 0.06}};
  const Edge to = {{0.003, 0.06, -0.06}, {0.003, 0.06, 0.06}};
  box.stroke(straight_path(from, to, 0.0005));
  EXPECT_EQ(box.check(), "");
  const auto pieces = find_pieces(box.topology());
  EXPECT_EQ(pieces.count, 2u);
  EXPECT_NEAR(box.total().opened_area_m2, 0.08 * 0.08, 0.05 * 0.08 * 0.08);
  EXPECT_EQ(box.total().waiting_area_m2, 0);
}

}  // namespace
}  // namespace trocar::cutting::testing
