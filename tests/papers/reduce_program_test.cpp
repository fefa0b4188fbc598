// trocar-organ reduce as a process: the reduced model and the tables that it leaves, and its one
// line for each mistake.

#include <algorithm>

#include "server/organs/organ/organ_file.h"
#include "server/papers/reduction/reduction_file.h"
#include "tests/support/program_fixture.h"

namespace trocar {
namespace {

class ReduceProgram : public testing::ProgramFixture {
 protected:
  ReduceProgram() : ProgramFixture("trocar-organ") {}

  int reduce(const std::string& organ, const std::vector<std::string>& more = {},
             const char* out = "small.reduction") {
    std::vector<std::string> arguments{
        "reduce",  organ,   "--places",      "4",      "--directions", "2", "--magnitudes",  "2",
        "--modes", "4",     "--creep-nodes", "1",      "--check",      "1", "--check-creep", "1",
        "--out",   at(out), "--results",     at("out")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
};

TEST_F(ReduceProgram, LeavesAReducedModelAndHowFarItIsOff) {
  ASSERT_EQ(run({"make", "liver", "--tets", "1000", "--out", at("small.organ")}), 0) << log();
  ASSERT_EQ(reduce(at("small.organ"), {"--force", "0.2"}), 0) << log();
  const auto text = log();
  EXPECT_NE(text.find("4 modes of 16 snapshots"), std::string::npos) << text;
  EXPECT_NE(text.find("2 loads outside the training"), std::string::npos) << text;
  const auto organ = organ::read_organ(folder_ / "small.organ");
  ASSERT_TRUE(organ.ok());
  const auto reduction = reduction::read_reduction(folder_ / "small.reduction", *organ);
  ASSERT_TRUE(reduction.ok()) << reduction.error().message;
  EXPECT_EQ(reduction->mode_count(), 4u);
  EXPECT_EQ(reduction->force_n, 0.2);
  ASSERT_EQ(reduction->creep.size(), 1u);
  EXPECT_EQ(reduction->creep_times_s.back(), 20);
  const auto modes = read(folder_ / "out" / "modes.csv");
  EXPECT_EQ(std::count(modes.begin(), modes.end(), '\n'), 4) << modes;  // 1, 2, 4 and the head
  for (const char* name : {"loads.csv", "creep.csv", "errors.svg", "creep.svg"})
    EXPECT_GT(read(folder_ / "out" / name).size(), 100u) << name;
  // The same again is the same file, and threads change nothing.
  ASSERT_EQ(reduce(at("small.organ"), {"--force", "0.2", "--threads", "2"}, "again.reduction"), 0)
      << log();
  EXPECT_EQ(read(folder_ / "again.reduction"), read(folder_ / "small.reduction"));
}

TEST_F(ReduceProgram, SaysEachMistakeInOneLine) {
  const auto says = [&](std::vector<std::string> arguments, int code, const char* what) {
    arguments.insert(arguments.begin(), "reduce");
    arguments.insert(arguments.end(), {"--results", at("results"), "--out", at("nothing")});
    EXPECT_EQ(run(arguments), code) << what;
    expect_line(what);
  };
  says({"lattice"}, 3, "lattice: has no tets, which a reduced model needs");
  says({"liver", "--modes", "65"}, 2, "--modes: 65 is not from 1 to 64");
  says({"liver", "--force", "-1"}, 2, "--force: must be above 0");
  says({"liver", "--check", "1"}, 2, "--check-creep: at most as many as --check");
  says({at("none.organ")}, 3, "none.organ");
  EXPECT_FALSE(std::filesystem::is_regular_file(at("nothing")));
  EXPECT_EQ(run({"reduce", "liver", "--results", at("out"), "--out", at("none/liver.reduction")}),
            5);
  expect_line("none/liver.reduction: cannot be written, its folder is not there");
}

TEST_F(ReduceProgram, HelpTeachesTheMethod) {
  EXPECT_EQ(run({"reduce", "--help"}), 0);
  for (const char* says : {"Dogan 2011", "B^T K B xi = B^T f", "trocar-organ reduce liver"})
    EXPECT_NE(log().find(says), std::string::npos) << says;
}

}  // namespace
}  // namespace trocar
