// An organ's name says what it looks like.

#include "client/shape/tissue_look.h"

#include <gtest/gtest.h>

#include <set>

namespace trocar::shape {
namespace {

TEST(TissueLook, FollowsFromTheName) {
  const auto row = [](std::string_view name) { return &look_of(name) - kTissueLooks.data(); };
  EXPECT_EQ(row("liver"), 0);
  EXPECT_EQ(row("elastic-liver"), 0);
  EXPECT_EQ(row("something else"), 0);
  EXPECT_EQ(row(""), 0);
  EXPECT_EQ(row("Left_Kidney_03"), row("renal phantom"));
  EXPECT_EQ(row("gallbladder_wall"), row("GALL"));
  EXPECT_EQ(row("stomach_wall"), row("stomach"));
  std::set<std::ptrdiff_t> rows;
  for (const auto* name : {"liver", "stomach", "kidney", "spleen", "gallbladder", "fat", "bone",
                           "aorta", "pegs", "ring", "chest", "plate", "heart", "lung", "colon"})
    EXPECT_TRUE(rows.insert(row(name)).second) << name << " looks as another one does";
}

TEST(TissueLook, EveryRowIsFoundByItsOwnWords) {
  for (const TissueLook& look : kTissueLooks) {
    ASSERT_FALSE(look.words.empty());
    EXPECT_EQ(&look_of(look.words.substr(0, look.words.find(' '))), &look);
    for (const LookFigures& figures : {outside_figures(look), inside_figures(look)})
      for (const auto& colours : {figures.dark, figures.light})
        for (const Vec3f& c : colours)
          for (const float part : {c.x, c.y, c.z}) {
            EXPECT_GT(part, 0) << look.words;
            EXPECT_LT(part, 0.7f) << look.words << ": no tissue is as white";
          }
  }
}

TEST(TissueLook, LoosePartsOfAPegBoardDiffer) {
  // A held triangle, and two that are not.
  const std::vector<TriangleCorners> triangles{{3, 4, 5}, {0, 1, 2}, {6, 7, 8}};
  const std::vector<std::uint32_t> held{4};
  const auto parts = parts_of(look_of("pegs"), 9, triangles, held);
  EXPECT_EQ(parts, (std::vector<std::uint8_t>{1, 1, 1, 0, 0, 0, 2, 2, 2}));
  const auto figures = outside_figures(look_of("pegs"));
  EXPECT_NE(figures.light[0], figures.light[1]);
  EXPECT_NE(figures.light[1], figures.light[2]);
  EXPECT_EQ(parts_of(look_of("liver"), 9, triangles, held), std::vector<std::uint8_t>(9, 0));
}

}  // namespace
}  // namespace trocar::shape
