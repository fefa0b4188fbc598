// Checks what a scene's threads may be, and how they are laid out.

#include "server/tissue/thread/rules.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/thread/laid_thread.h"

namespace trocar::thread {
namespace {

std::string error_of(const Rules& rules) {
  const auto valid = validate(rules);
  return valid.ok() ? "" : valid.error().message;
}

TEST(Rules, ThreadLiesAlongItsPathAtRest) {
  const auto nodes = nodes_along({{0, 0, 0}, {0.3, 0, 0}});
  ASSERT_EQ(nodes.size(), 301u);
  EXPECT_NEAR(nodes.back().x, 0.3, 1e-9);
  const auto bent = nodes_along({{0, 0, 0}, {0.05, 0, 0}, {0.05, 0.05, 0}});
  for (std::size_t i = 1; i < bent.size(); ++i)
    EXPECT_NEAR(length(bent[i] - bent[i - 1]), kSegmentM, 1e-12);
}

TEST(Rules, ErrorsNameFieldAndLimit) {
  auto rules = rules_of(silk_along({{0, 0, 0}, {0.1, 0, 0}}));
  EXPECT_EQ(error_of(rules), "");
  auto wrong = rules;
  wrong.threads[0].path_m.pop_back();
  EXPECT_EQ(error_of(wrong), "thread[0].path_m: has 1 points, write 2 to 4096");
  wrong = rules;
  wrong.threads[0].path_m[1].x = 1.5;
  EXPECT_EQ(error_of(wrong),
            "thread[0].path_m: is too long, allowed are 1199 mm of all threads together");
  wrong = rules;
  wrong.threads[0].path_m[1].x = 0.002;
  EXPECT_EQ(error_of(wrong), "thread[0].path_m: is too short, write at least 3 mm");
  wrong = rules;
  wrong.threads[0].end.load_n = {0, -51, 0};
  EXPECT_EQ(error_of(wrong), "thread[0].end.load_n: is outside 0 to 50 N");
  wrong = rules;
  wrong.threads[0].start = {.is_held = true, .load_n = {1, 0, 0}};
  EXPECT_NE(error_of(wrong), "");
  wrong = rules;
  wrong.pegs.push_back({{0.05, 0, -0.1}, {0.05, 0, 0.1}, 0.002, 0.2});
  EXPECT_EQ(error_of(wrong),
            "thread[0].path_m: passes through peg[0], lay it outside: its corners are rounded by 1 "
            "mm");
  wrong.pegs[0].radius_m = 0.0005;
  EXPECT_EQ(error_of(wrong), "peg[0].radius_m: is outside 0.001 to 1 m");
}

TEST(Sutures, AreThoseOfTheTable) {
  const auto silk = suture_of(Material::Silk, Size::Usp3_0);
  EXPECT_NEAR(silk.stretch_n, 361, 1);
  EXPECT_NEAR(silk.bending_nm2, 3.6e-8, 0.1e-8);
  EXPECT_NEAR(silk.density_kg_m, 46e-6, 1e-6);
  EXPECT_NEAR(suture_of(Material::Nylon, Size::Usp3_0).breaks_n, 30.9, 0.3);
  EXPECT_NEAR(suture_of(Material::Nylon, Size::Usp3_0).bending_nm2, 2.5e-7, 0.1e-7);
  EXPECT_NEAR(suture_of(Material::Polypropylene, Size::Usp3_0).breaks_n, 18.9, 0.3);
  EXPECT_GT(suture_of(Material::Silk, Size::Usp2_0).breaks_n, silk.breaks_n);
}

}  // namespace
}  // namespace trocar::thread
