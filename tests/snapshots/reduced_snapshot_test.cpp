// States of a session that a reduction moves: read again, and continued.

#include <gtest/gtest.h>

#include "tests/reduce/reduced_block.h"
#include "tests/snapshots/random_session.h"

namespace trocar::testing {
namespace {

TEST(ReducedSnapshots, OfASessionWithAReductionAreReadAndContinuedBitForBit) {
  const reduce::testing::ReducedBlock block(4);
  RandomSession session({block.organ, block.local, 0}, 1);
  EXPECT_EQ(session.run(30), "");
  EXPECT_GT(session.figures().reduced, 0u);
}

}  // namespace
}  // namespace trocar::testing
