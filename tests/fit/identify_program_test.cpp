// trocar-organ identify as a process: the constants it prints and leaves, and its one line for each
// mistake.

#include <algorithm>
#include <cmath>

#include "tests/support/program_fixture.h"

namespace trocar {
namespace {

class IdentifyProgram : public testing::ProgramFixture {
 protected:
  IdentifyProgram() : ProgramFixture("trocar-organ") {}

  int identify(const std::string& curves, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"identify",   curves, "--length-mm", "20",
                                       "--area-mm2", "100",  "--out",       at("out")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  const std::string curves_ = std::string(TROCAR_SOURCE_DIR) + "/deploy/scenes/relax.csv";
};

TEST_F(IdentifyProgram, FindsTheConstantsFromWhichTheExampleWasMade) {
  ASSERT_EQ(identify(curves_, {"--name", "sample"}), 0) << log();
  const auto text = log();
  const auto at = text.find("\nC10 ");
  ASSERT_NE(at, std::string::npos) << text;
  EXPECT_NEAR(std::strtod(&text[at + 5], nullptr), 883.8, 60);
  const auto toml = read(folder_ / "out" / "material.toml");
  EXPECT_NE(toml.find("name = \"sample\""), std::string::npos) << toml;
  EXPECT_NE(toml.find("relaxation_times_s = ["), std::string::npos) << toml;
  for (const char* name : {"identify.csv", "time.svg", "stretch.svg"})
    EXPECT_GT(read(folder_ / "out" / name).size(), 1000u) << name;
}

TEST_F(IdentifyProgram, LeavesAMaterialThatOrgansAreMadeOf) {
  ASSERT_EQ(identify(curves_, {"--name", "the \"soft\" one"}), 0) << log();
  const auto material = (folder_ / "out" / "material.toml").string();
  ASSERT_EQ(run({"make", "liver", "--tets", "2000", "--material", material, "--out",
                 at("measured.organ")}),
            0)
      << log();
  EXPECT_NE(log().find("measured, the \"soft\" one (" + material + ")"), std::string::npos)
      << log();
  const auto wrong = write("wrong.toml", "[hyperelastic]\nname = \"x\"\nc_i0_pa = [-3]\n");
  EXPECT_EQ(run({"make", "liver", "--tets", "2000", "--material", wrong, "--out", at("no.organ")}),
            3);
  expect_line("wrong.toml:1: key hyperelastic.bulk_modulus_pa: is missing");
  EXPECT_FALSE(std::filesystem::exists(at("no.organ")));
}

TEST_F(IdentifyProgram, SaysEachMistakeInOneLine) {
  EXPECT_EQ(identify(write("empty.csv", "")), 3);
  expect_line("empty.csv: has no measurements");
  EXPECT_EQ(identify(at("none.csv")), 3);
  expect_line("cannot be opened");
  EXPECT_EQ(identify(curves_, {"--start", "0.7:1,0.4:5"}), 2);
  expect_line("add up to 1.1");
  EXPECT_EQ(identify(curves_, {"--start", "0.7"}), 2);
  expect_line("write 0.5:0.6");
  EXPECT_EQ(identify(curves_, {"--order", "9"}), 2);
  expect_line("trocar-organ: the order must be from 1 to 5");
  EXPECT_EQ(identify(curves_, {"--start", "0.999:1"}), 2);
  expect_line("add up to more than 0.995");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
}

}  // namespace
}  // namespace trocar
