#include "common/base/quote.h"

#include <gtest/gtest.h>

namespace trocar {
namespace {

TEST(Quote, EscapesWhatWouldEndTheStringOrIsNoText) {
  EXPECT_EQ(quote(""), "\"\"");
  EXPECT_EQ(quote("a \"b\" \\ c"), "\"a \\\"b\\\" \\\\ c\"");
  EXPECT_EQ(quote("l\n\x7f\x01"), "\"l\\u000a\\u007f\\u0001\"");
  EXPECT_EQ(quote("Do\u011fan"), "\"Do\u011fan\"");
}

}  // namespace
}  // namespace trocar
