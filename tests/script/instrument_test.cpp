#include "common/tool/instrument.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace trocar::tool {
namespace {

TEST(Instruments, ArePossibleAndToldApart) {
  std::set<std::string_view> names;
  for (const auto& kind : instruments()) {
    EXPECT_TRUE(is_valid(kind.shape)) << kind.name;
    EXPECT_TRUE(names.insert(kind.name).second) << kind.name;
    EXPECT_FALSE(kind.text.empty()) << kind.name;
    EXPECT_EQ(find_instrument(kind.name), &kind);
    EXPECT_EQ(possible(kind.shape, kind.grip_verb()), kind.grip_verb()) << kind.name;
    EXPECT_EQ(possible(kind.shape, kind.button_verb()), kind.button_verb()) << kind.name;
    EXPECT_EQ(possible(kind.shape, main_verb(kind.shape)), main_verb(kind.shape)) << kind.name;
  }
  EXPECT_EQ(names.size(), 13u);
  EXPECT_EQ(find_instrument("spoon"), nullptr);
  EXPECT_EQ(instruments().front().shape, ToolShape{}) << "what has always been";
}

TEST(Instruments, DoWhatTheirNamesSay) {
  const auto does = [](std::string_view name, Verb main, Verb grip, Verb button) {
    const auto* kind = find_instrument(name);
    return main_verb(kind->shape) == main && kind->grip_verb() == grip &&
           kind->button_verb() == button;
  };
  using enum Verb;
  EXPECT_TRUE(does("all", Push, Grasp, Cut));
  EXPECT_TRUE(does("probe", Push, Push, Push));
  EXPECT_TRUE(does("grasper", Grasp, Grasp, Grasp));
  EXPECT_TRUE(does("scissors", Cut, Cut, Cut));
  EXPECT_TRUE(does("scalpel", Cut, Cut, Cut));
  EXPECT_TRUE(does("hook", Cut, Grasp, Cut));
  EXPECT_TRUE(does("spatula", Push, Push, Push));
  EXPECT_TRUE(does("endoscope", Push, Push, Push));
  EXPECT_TRUE(does("endoscope-30", Push, Push, Push));
  EXPECT_TRUE(does("suction", Push, Push, Push));
  EXPECT_TRUE(does("clips", Grasp, Grasp, Grasp));
  EXPECT_TRUE(does("coagulator", Push, Push, Push));
  EXPECT_LT(find_instrument("hook")->shape.grip_n, find_instrument("grasper")->shape.grip_n);
  EXPECT_LT(find_instrument("scalpel")->shape.radius_m, find_instrument("probe")->shape.radius_m);
}

std::string error_of(std::string_view text) {
  const auto read = read_instruments_text(text, "own.toml");
  return read ? "" : read.error().message;
}

TEST(Instruments, OfOnesOwnAreReadStrictly) {
  const auto read = read_instruments_text(
      "[[instrument]]\nname = 'fork'\ntext = 'two tines'\nradius_mm = 1\n", "own.toml");
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->size(), 1u);
  EXPECT_EQ(read->front().shape.radius_m, 0.001f);
  EXPECT_EQ(possible(read->front().shape, Verb::Grasp), Verb::Push);
  EXPECT_NE(find_instrument(*read, "fork"), nullptr);

  const std::string fork = "[[instrument]]\nname = 'fork'\ntext = 'two tines'\n";
  EXPECT_NE(error_of(""), "");
  EXPECT_NE(error_of(fork + fork).find("own.toml:5"), std::string::npos) << error_of(fork + fork);
  for (const std::string wrong :
       {"radius_mm = 0.1", "radius = 1", "form = 'spoon'", "form = 'scissors'", "grip_n = 0.01",
        "edge_mm = nan", "text = 3", "extra = true"}) {
    const auto error = error_of(fork + wrong);
    EXPECT_NE(error.find("own.toml:"), std::string::npos) << wrong << ": " << error;
  }
  EXPECT_NE(error_of("[[instrument]]\nname = 'A fork'\ntext = 'x'\n").find("name"),
            std::string::npos);
  std::string many;
  for (int i = 0; i < 40; ++i)
    many += "[[instrument]]\nname = 'fork-" + std::to_string(i) + "'\ntext = 'x'\n";
  EXPECT_NE(error_of(many).find("too many"), std::string::npos);
}

}  // namespace
}  // namespace trocar::tool
