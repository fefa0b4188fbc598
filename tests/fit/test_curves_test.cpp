// Force curves of specimens from CSV files: units and signs, and one line for each mistake.

#include "server/lab/fit/test_curves.h"

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace trocar::fit {
namespace {

TEST(TestCurves, AreReadWithTheirUnitsAndTests) {
  const auto curves = parse_test_curves(
      "curve,test,time_s,displacement_mm,force_n\n# a remark\n"
      "a,tension,0,0,0\na,tension,1,1,0.1\na,tension,2,2,0.2\na,tension,3,3,0.3\na,tension,4,3,0."
      "2\n"
      "b,compression,0,0,0\nb,compression,1,1,0.2\nb,compression,2,2,0.4\nb,compression,3,2,0.3\n"
      "b,compression,4,2,0.25\n",
      "x.csv", {"tension", 0.02, 1e-4});
  ASSERT_TRUE(curves.ok()) << curves.error().message;
  ASSERT_EQ(curves->size(), 2u);
  EXPECT_NEAR((*curves)[0].stretches[2], 1.1, 1e-12);
  EXPECT_NEAR((*curves)[0].stresses_pa[2], 2000, 1e-9);
  EXPECT_NEAR((*curves)[1].stretches[2], 0.9, 1e-12);
  EXPECT_NEAR((*curves)[1].stresses_pa[2], -4000, 1e-9);
}

TEST(TestCurves, AreReadAsSpreadsheetsWriteThem) {
  const auto curves = parse_test_curves(
      "\xEF\xBB\xBFtime_s;curve;displacement_mm;force_n\r\n0;\"left; upper\";0;+0\r\n"
      "1;\"left; upper\";+1;+0.1\r\n2;\"left; upper\";2;0.2\r\n3;\"left; upper\";3;0.3\r\n"
      "4;\"left; upper\";4;.4\r\n",
      "x.csv", {"tension", 0.02, 1e-4});
  ASSERT_TRUE(curves.ok()) << curves.error().message;
  ASSERT_EQ(curves->size(), 1u);
  EXPECT_EQ((*curves)[0].name, "left; upper");
  EXPECT_NEAR((*curves)[0].stresses_pa[4], 4000, 1e-9);
}

TEST(TestCurves, BadOnesAreRefusedInOneLine) {
  const std::string header = "time_s,displacement_mm,force_n\n";
  const std::string good = "0,0,0\n1,1,0.1\n2,2,0.2\n3,3,0.3\n4,4,0.4\n";
  const auto refused = [](const std::string& text, const std::string& says,
                          const SpecimenSize& size = {"tension", 0.02, 1e-4}) {
    const auto curves = parse_test_curves(text, "x.csv", size);
    ASSERT_FALSE(curves.ok()) << says;
    EXPECT_NE(curves.error().message.find(says), std::string::npos) << curves.error().message;
    EXPECT_EQ(curves.error().message.find('\n'), std::string::npos);
  };
  ASSERT_TRUE(parse_test_curves(header + good, "x.csv", {"tension", 0.02, 1e-4}).ok());
  refused("", "x.csv: has no measurements");
  refused(header, "x.csv: has no measurements");
  refused("1,2,3\n", "x.csv:1: is no header");
  refused(header + "0,0\n", "x.csv:2: time_s, displacement_mm and force_n are not all numbers");
  refused(header + "0,0,nan\n", "not all numbers");
  refused(header + "0,0,+-1\n", "not all numbers");
  // Decimal commas.
  refused(header + good + "5,5,0,5\n",
          "x.csv:7: has 4 cells under 3 columns: write numbers with a");
  refused("time_s;displacement_mm;force_n\n0;0;0\n1;1;0,1\n", "x.csv:3: time_s, displacement_mm");
  refused(header + "0,0,0\n", "fewer than 5");
  refused(header + good + "3.5,4,0.4\n", "x.csv:7: time_s is not above the one before");
  refused(header + "0,0,0\n1,1000,0.1\n", "x.csv:3: a displacement of 1000 mm");
  refused(header + "0,0,0\n1,1e-5,0.1\n2,2e-5,0.2\n3,3e-5,0.3\n4,4e-5,0.4\n", "in mm?");
  refused(header + "0,0,0\n1,1,1e5\n2,2,2e5\n3,3,3e5\n4,4,4e5\n", "is force_n in N");
  refused(header + "0,0,0\n1,1,1e-9\n2,2,2e-9\n3,3,3e-9\n4,4,4e-9\n", "is force_n in N");
  refused(header + "0,0,0\n1,1,-.1\n2,2,-.2\n3,3,-.3\n4,4,-.4\n", "against the displacement");
  refused(header + good, "test 'torsion' is not known", {"torsion", 0.02, 1e-4});
  refused(header + good, "length and area must be above 0", {"tension", 0, 1e-4});
  refused(header + "0,0,0\n1,1,.1\n2,2,.2\n3,3,.3\n4e6,4,.4\n", "in seconds?");
}

TEST(TestCurves, AnyBytesAreRefusedOrRead) {
  trocar::testing::Random random(9);
  const std::string alphabet = "0123456789.,;-+eE\n\"#ab \ttime_s,displacement_mm,force_n";
  for (int trial = 0; trial < 2000; ++trial) {
    std::string text = random.below(2) == 0 ? "time_s,displacement_mm,force_n\n" : "";
    for (std::uint32_t i = random.below(120); i > 0; --i)
      text += alphabet[random.below(static_cast<std::uint32_t>(alphabet.size()))];
    const auto curves = parse_test_curves(text, "x.csv", {"tension", 0.02, 1e-4});
    if (!curves.ok()) {
      EXPECT_TRUE(curves.error().message.starts_with("x.csv")) << text;
    }
  }
}

}  // namespace
}  // namespace trocar::fit
