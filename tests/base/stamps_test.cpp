#include "common/base/stamps.h"

#include <gtest/gtest.h>

namespace trocar {
namespace {

TEST(Stamps, AMarkIsThereUntilAllAreTakenAway) {
  Stamps stamps;
  stamps.resize(3);
  EXPECT_FALSE(stamps.has(1)) << "before the first begin(), too";
  EXPECT_TRUE(stamps.insert(1));
  EXPECT_FALSE(stamps.insert(1)) << "it had one";
  EXPECT_TRUE(stamps.has(1));
  EXPECT_FALSE(stamps.has(0));
  stamps.begin();
  EXPECT_FALSE(stamps.has(1));
  EXPECT_TRUE(stamps.insert(1));
}

TEST(Stamps, NewPlacesHaveNoMarkAndOldOnesKeepTheirs) {
  Stamps stamps;
  stamps.resize(1);
  stamps.begin();
  stamps.insert(0);
  stamps.resize(2);
  EXPECT_TRUE(stamps.has(0));
  EXPECT_FALSE(stamps.has(1));
}

}  // namespace
}  // namespace trocar
