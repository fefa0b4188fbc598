// trocar-sim as a process: exit codes, and what an interrupt leaves behind.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "tests/support/program_fixture.h"

namespace trocar {
namespace {

namespace fs = std::filesystem;

class SimProgram : public testing::ProgramFixture {
 protected:
  SimProgram() : ProgramFixture("trocar-sim") {}
};

TEST_F(SimProgram, TheExampleRunsAndWritesTheSameBytesTwice) {
  const std::string example = std::string(TROCAR_SOURCE_DIR) + "/deploy/scenes/pull.toml";
  const auto a = folder_ / "a", b = folder_ / "b";
  ASSERT_EQ(run({example, "--out", a.string()}), 0) << log();
  ASSERT_EQ(run({example, "--out", b.string()}), 0) << log();
  for (const char* file : {"probes.csv", "field_0000500ms.csv", "field_0001500ms.vtu"}) {
    EXPECT_FALSE(read(a / file).empty()) << file;
    EXPECT_EQ(read(a / file), read(b / file)) << file;
  }
}

TEST_F(SimProgram, TheOffLineSolverLeavesAStateFromWhichItGoesOn) {
  const std::string example = std::string(TROCAR_SOURCE_DIR) + "/deploy/scenes/stretch.toml";
  const auto out = folder_ / "out";
  const std::vector<std::string> fem{
      example, "--solver", "fem", "--out", out.string(), "--material", "human_liver_nava2008"};
  ASSERT_EQ(run(fem), 0) << log();
  EXPECT_NE(log().find("750 quadratic elements"), std::string::npos) << log();
  const auto probes = read(out / "probes.csv");
  EXPECT_EQ(std::count(probes.begin(), probes.end(), '\n'), 9) << "a row per load step";
  auto again = fem;
  again.insert(again.end(), {"--resume", (out / "fem.state").string()});
  ASSERT_EQ(run(again), 0) << log();
  again.insert(again.end(), {"--elements", "linear"});
  EXPECT_EQ(run(again), 3);
  EXPECT_NE(log().find("fem.state: is of another organ, material"), std::string::npos) << log();
  auto unknown = fem;
  unknown.back() = "rubber";
  EXPECT_EQ(run(unknown), 2);
  EXPECT_NE(log().find("write human_liver_nava2008"), std::string::npos) << log();
}

TEST_F(SimProgram, PlotsShowEachProbeAndForceAgainstDisplacement) {
  const std::string example = std::string(TROCAR_SOURCE_DIR) + "/deploy/scenes/pull.toml";
  const auto out = folder_ / "out";
  ASSERT_EQ(run({example, "--out", out.string(), "--plot"}), 0) << log();
  for (const char* file : {"probe_top_reaction.svg", "probe_fixed_reaction.svg",
                           "probe_middle_displacement.svg", "force_top.svg"})
    EXPECT_NE(read(out / file).find("</svg>"), std::string::npos) << file;
  EXPECT_NE(read(out / "force_top.svg").find("displacement (mm)"), std::string::npos);
  EXPECT_NE(read(out / "probe_top_reaction.svg").find("reaction (N)"), std::string::npos);
}

TEST_F(SimProgram, AnInterruptLeavesReadableFiles) {
  const auto scenario = write("long.toml", R"([organ]
source = "lattice"
nodes = [8, 8, 8]
[run]
seconds = 3600
[gravity]
m_s2 = [0, -9.81, 0]
[[probe]]
set = "all"
quantity = "displacement"
rate_hz = 1000
[output]
fields_s = [0, 0.005]
)");
  const auto out = folder_ / "out";
  start({scenario, "--out", out.string()});
  // It is running once the second field is there; a simulated hour is not over by then.
  for (int i = 0; i < 6000 && !fs::exists(out / "field_0000005ms.vtu"); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  ASSERT_TRUE(fs::exists(out / "field_0000005ms.vtu")) << log();
  kill(pid_, SIGINT);
  ASSERT_EQ(wait(), 0) << log();
  EXPECT_NE(log().find("stopped at "), std::string::npos) << log();

  const std::string csv = read(out / "probes.csv");
  ASSERT_FALSE(csv.empty());
  EXPECT_EQ(csv.back(), '\n') << "the last row is whole";
  std::istringstream lines(csv);
  std::string line;
  int rows = 0;
  while (std::getline(lines, line)) {
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 3) << line;
    ++rows;
  }
  EXPECT_GE(rows, 6) << "header and the steps before the field";
  const std::string vtu = read(out / "field_0000005ms.vtu");
  EXPECT_NE(vtu.find("NumberOfPoints=\"512\" NumberOfCells=\"1344\""), std::string::npos);
  EXPECT_TRUE(vtu.ends_with("</VTKFile>\n"));
  for (const auto& entry : fs::directory_iterator(out))
    EXPECT_NE(entry.path().extension(), ".part") << "half a file";
}

TEST_F(SimProgram, WhatOnlySessionsDoIsSaidInOneLine) {
  const auto tears = write("tears.toml",
                           "[organ]\nsource = \"block\"\nnodes = [3, 3, 3]\n[material]\n"
                           "tear_stretch = 1.3\n[run]\nseconds = 0.01\n");
  ASSERT_EQ(run({tears, "--out", at("tears")}), 0) << log();
  EXPECT_NE(log().find("tears.toml: tear_stretch is left out"), std::string::npos) << log();
  const auto cuts = write("cuts.toml",
                          "[organ]\nsource = \"block\"\n[run]\nseconds = 0.01\n[[tool]]\n"
                          "[[tool.key]]\ntime_s = 0\nposition_mm = [0, 0, 0]\nverb = \"cut\"\n");
  EXPECT_EQ(run({cuts, "--out", at("cuts")}), 3);
  EXPECT_NE(log().find("only sessions cut"), std::string::npos) << log();
  const std::string line = log();
  EXPECT_EQ(std::count(line.begin(), line.end(), '\n'), 1) << line;
}

TEST_F(SimProgram, ExitCodesSayWhatWasWrong) {
  EXPECT_EQ(run({"--version"}), 0);
  EXPECT_EQ(run({"--help"}), 0);
  EXPECT_NE(log().find("Examples:"), std::string::npos);
  EXPECT_EQ(run({}), 2);
  EXPECT_EQ(run({"a.toml", "--solver", "magic"}), 2);
  EXPECT_EQ(run({(folder_ / "missing.toml").string()}), 3);
  const auto bad = write("bad.toml", "[organ]\nsource = \"lattice\"\n[run]\nsecond = 1\n");
  EXPECT_EQ(run({bad}), 3);
  EXPECT_NE(log().find("bad.toml:"), std::string::npos) << log();
  const auto early = write(
      "early.toml",
      "[organ]\nsource = \"lattice\"\n[run]\nseconds = 1\nnodes = 10\nboundary = \"magic\"\n");
  EXPECT_EQ(run({early}), 3);
  EXPECT_NE(log().find("early.toml:6: key run.boundary: "), std::string::npos) << log();
  const auto good = write("good.toml", "[organ]\nsource = \"lattice\"\n[run]\nseconds = 0.001\n");
  write("file", "");
  EXPECT_EQ(run({good, "--out", (folder_ / "file" / "x").string()}), 5) << log();
}

}  // namespace
}  // namespace trocar
