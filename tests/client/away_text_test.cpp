#include "client/ui/away_text.h"

#include <gtest/gtest.h>

namespace trocar::ui {
namespace {

TEST(AwayText, SaysSinceWhenAndForHowLong) {
  EXPECT_EQ(describe_absence(4.2, 25.8),
            "The connection broke 4 s ago. Trying again; your seat is kept for 26 s.");
  EXPECT_EQ(describe_absence(0.2, 29.8),
            "The connection broke just now. Trying again; your seat is kept for 30 s.");
}

}  // namespace
}  // namespace trocar::ui
