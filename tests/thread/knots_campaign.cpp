// A thousand seeded pulls of six knots. TROCAR_PULLS says how many.

#include <cstdlib>

#include "tests/thread/seeded_pulls.h"

namespace trocar::thread {
namespace {

TEST(KnotsCampaign, CrossingsAreKept) {
  const char* const count = std::getenv("TROCAR_PULLS");
  const int pulls = count != nullptr ? std::atoi(count) : 1000;
  testing::Random random(1000);
  for (int k = 0; k < pulls; ++k)
    expect_kept(kKnots[static_cast<std::size_t>(k) % kKnots.size()], random, 300);
}

}  // namespace
}  // namespace trocar::thread
