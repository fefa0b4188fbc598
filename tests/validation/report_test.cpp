// Tests what counts as kept, missed and broken, and what the files say of it.

#include "tests/validation/report.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/base/json.h"

namespace trocar::validation {
namespace {

Check check_with(double error, const Bound& bound) {
  Section section{.name = "ours/some"};
  section.at_most("figure", "reference", error, bound, "What is compared.");
  return section.checks.front();
}

TEST(Verdict, ABoundIsKeptUpToItsValueAndNotBeyond) {
  EXPECT_EQ(check_with(0.02, law(0.02, "a law")).verdict(), Verdict::Kept);
  EXPECT_EQ(check_with(0.0201, law(0.02, "a law")).verdict(), Verdict::Broken);
  EXPECT_TRUE(check_with(0.0201, law(0.02, "a law")).fails());
  EXPECT_EQ(check_with(std::nan(""), law(0.02, "a law")).verdict(), Verdict::Broken);
}

TEST(Verdict, ADeclaredMissFailsIfItGrowsOrIsKeptAfterAll) {
  const auto bound = target(0.02, "an aim").missed(0.05);
  EXPECT_EQ(check_with(0.04, bound).verdict(), Verdict::Missed);
  EXPECT_FALSE(check_with(0.04, bound).fails());
  EXPECT_EQ(check_with(0.051, bound).verdict(), Verdict::Broken);
  EXPECT_EQ(check_with(0.01, bound).verdict(), Verdict::Outdated);
  EXPECT_TRUE(check_with(0.01, bound).fails());
  EXPECT_EQ(check_with(std::nan(""), bound).verdict(), Verdict::Broken);
}

TEST(Verdict, OfALeastValueTheRecordIsTheLeastSeen) {
  const auto verdict_of = [](double ours) {
    Section section{.name = "ours/some"};
    section.at_least("figure", "more", ours, paper(2, "figure 1").missed(1.5), "What.");
    return section.checks.front().verdict();
  };
  EXPECT_EQ(verdict_of(2.1), Verdict::Outdated);
  EXPECT_EQ(verdict_of(1.6), Verdict::Missed);
  EXPECT_EQ(verdict_of(1.4), Verdict::Broken);
}

TEST(Verdict, AStepThatDidNotConvergeBreaksTheExperiment) {
  Section section{.name = "ours/some"};
  section.steps = 3;
  section.check_convergence();
  EXPECT_TRUE(section.checks.empty());
  section.unconverged_steps = 1;
  section.check_convergence();
  ASSERT_EQ(section.checks.size(), 1u);
  EXPECT_TRUE(section.checks.front().fails());
}

TEST(Verdict, WhatHasNoBoundIsNeverCountedAsKept) {
  Section section{.name = "ours/some"};
  section.measured("figure", "0.5", "What was measured.");
  const auto counts = count(section.checks);
  EXPECT_EQ(counts.kept, 0u);
  EXPECT_EQ(counts.measured, 1u);
  EXPECT_EQ(totals({section}),
            "0 bounds kept, 0 missed as declared, 0 broken, 1 figures without a bound");
}

TEST(ReportFiles, EachBoundHasItsSource) {
  Section section{.name = "ours/some"};
  section.at_most("figure", "reference", 0.04, target(0.02, "an aim").missed(0.05), "What.");
  const auto check = Json::parse(to_json({section})).at(0);
  EXPECT_EQ(check.at("verdict"), "missed");
  EXPECT_EQ(check.at("source"), "target: an aim");
  EXPECT_NE(to_csv({section}).find("ours/some/figure,reference,4 % off,0.04,0.02,missed,"
                                   "target: an aim,0.05,What."),
            std::string::npos);
  EXPECT_NE(to_markdown({.sections = {section}}).find("| target: an aim | missed |"),
            std::string::npos);
}

}  // namespace
}  // namespace trocar::validation
