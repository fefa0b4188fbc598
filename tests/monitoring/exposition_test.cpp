#include "server/session/monitoring/exposition.h"

#include <gtest/gtest.h>

#include <limits>

namespace trocar::monitoring {
namespace {

TEST(Exposition, OneFigureIsThreeLines) {
  Exposition text("trocar_");
  text.gauge("age_seconds", "Age of it.", 0.25);
  text.counter("ticks_total", "Ticks.", 1e6);
  EXPECT_EQ(text.text(),
            "# HELP trocar_age_seconds Age of it.\n# TYPE trocar_age_seconds gauge\n"
            "trocar_age_seconds 0.25\n"
            "# HELP trocar_ticks_total Ticks.\n# TYPE trocar_ticks_total counter\n"
            "trocar_ticks_total 1000000\n");
}

TEST(Exposition, LabelsAndHelpAreEscaped) {
  Exposition text("");
  text.gauges("a", "One\ntwo \\ \"three\"", "b", {{"x\"\\\n", 1}, {"y", 2}});
  EXPECT_EQ(text.text(),
            "# HELP a One\\ntwo \\\\ \"three\"\n# TYPE a gauge\na{b=\"x\\\"\\\\\\n\"} 1\n"
            "a{b=\"y\"} 2\n");
}

TEST(Exposition, WhatIsNoNumberHasItsOwnWord) {
  Exposition text("");
  const double infinity = std::numeric_limits<double>::infinity();
  text.gauges("a", "A.", "b",
              {{"x", std::numeric_limits<double>::quiet_NaN()}, {"y", infinity}, {"z", -infinity}});
  EXPECT_NE(text.text().find("} NaN\na{b=\"y\"} +Inf\na{b=\"z\"} -Inf\n"), std::string::npos);
}

}  // namespace
}  // namespace trocar::monitoring
