#include "common/base/backoff.h"

#include <gtest/gtest.h>

namespace trocar {
namespace {

using std::chrono::milliseconds;

TEST(Backoff, grows_to_the_longest_and_begins_anew) {
  Backoff pause(milliseconds(200), milliseconds(500), 1.5);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(pause.next(), milliseconds(200));
    EXPECT_EQ(pause.next(), milliseconds(300));
    EXPECT_EQ(pause.next(), milliseconds(450));
    EXPECT_EQ(pause.next(), milliseconds(500));
    EXPECT_EQ(pause.next(), milliseconds(500));
    pause.restart();
  }
}

}  // namespace
}  // namespace trocar
