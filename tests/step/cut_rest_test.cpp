#include "tests/step/cut_rest.h"

#include <gtest/gtest.h>

namespace trocar::step::testing {
namespace {

// Gravity keeps some shaking, as cut_rest_campaign.cpp says.
TEST(CutRest, AnOrganUnderTensionHoweverCutIsAsleepWithinTwoSeconds) {
  for (int organ = 0; organ < kLawOrgans; ++organ)
    for (const unsigned seed : {1u, 2u}) {
      const auto rest = run_cut_rest(organ, RestLoad::Tension, seed);
      EXPECT_GE(rest.asleep_after, 0) << rest.name << ": " << 1e3 * rest.motion.fastest_m_s
                                      << " mm/s, " << rest.motion.kinetic_j << " J";
    }
}

}  // namespace
}  // namespace trocar::step::testing
