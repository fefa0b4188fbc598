// cut_rest_test.cpp with a thousand scenes.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "tests/step/cut_rest.h"

namespace trocar::step::testing {
namespace {

TEST(CutRestCampaign, AThousandOrgansAreAsleepWithinTwoSeconds) {
  constexpr int kSeeds = 56;
  int awake[kRestLoads] = {}, latest = 0;
  for (unsigned seed = 1; seed <= kSeeds; ++seed)
    for (int organ = 0; organ < kLawOrgans; ++organ)
      for (int load = 0; load < kRestLoads; ++load) {
        const auto rest = run_cut_rest(organ, static_cast<RestLoad>(load), seed);
        EXPECT_GE(rest.asleep_after, 0) << rest.name;
        latest = std::max(latest, rest.asleep_after);
        awake[load] += rest.asleep_after < 0 ? 1 : 0;
      }
  std::printf(
      "of %d scenes each, awake without load %d, under tension %d, under gravity %d; the "
      "others asleep after %d ms at most\n",
      kSeeds * kLawOrgans, awake[0], awake[1], awake[2], latest);
}

}  // namespace
}  // namespace trocar::step::testing
