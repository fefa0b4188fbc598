// trocar-sim as a process: exit codes, and what an interrupt leaves behind.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
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

TEST_F(SimProgram, TheOffLineSolverRunsTheExampleOfAMeasuredMaterial) {
  const std::string example = std::string(TROCAR_SOURCE_DIR) + "/deploy/scenes/stretch.toml";
  const auto out = folder_ / "out";
  std::vector<std::string> fem{
      example, "--solver", "fem", "--out", out.string(), "--material", "human_liver_nava2008"};
  ASSERT_EQ(run(fem), 0) << log();
  EXPECT_NE(log().find("750 quadratic elements"), std::string::npos) << log();
  const auto probes = read(out / "probes.csv");
  EXPECT_EQ(std::count(probes.begin(), probes.end(), '\n'), 9) << "a row per load step";
  fem.back() = "rubber";
  EXPECT_EQ(run(fem), 2);
  EXPECT_NE(log().find("write human_liver_nava2008"), std::string::npos) << log();
  fem.back() = write("soft.toml",
                     "[hyperelastic]\nname = \"soft\"\nc_i0_pa = [500]\nbulk_modulus_pa = 2e4\n");
  fem.insert(fem.end(), {"--elements", "linear"});
  ASSERT_EQ(run(fem), 0) << log();
  EXPECT_NE(read(out / "probes.csv"), probes);
  fem[6] = write("wrong.toml", "[hyperelastic]\nname = \"x\"\nc_i0_pa = [500]\n");
  EXPECT_EQ(run(fem), 3);
  EXPECT_NE(log().find("wrong.toml:1: key hyperelastic.bulk_modulus_pa: is missing"),
            std::string::npos)
      << log();
}

// A block under a force that grows, for the off-line solver; `half` of it ends in the middle.
std::string swayed_block(bool is_half, const std::string& force = "[0.02, 0, 0]") {
  return std::string("[organ]\nsource = \"block\"\nnodes = [3, 3, 3]\nspacing_mm = 8\n") +
         "[material]\nelastic_law = \"neo-hookean\"\npoisson_ratio = 0.4\n" +
         "young_modulus_pa = 6000\n" +
         "[[nodes]]\nname = \"top\"\nbox_min_mm = [-9, 7, -9]\nbox_max_mm = [9, 9, 9]\n" +
         "[run]\nseconds = " + (is_half ? "0.01" : "0.02") +
         "\n[[force]]\nset = \"top\"\n[[force.key]]\ntime_s = 0\nforce_n = [0, 0, 0]\n" +
         "[[force.key]]\ntime_s = 0.01\nforce_n = " + force +
         "\n[[probe]]\nset = \"top\"\nquantity = \"displacement\"\nrate_hz = 1000\n" +
         "[output]\nfields_s = [0, 0.005" + (is_half ? "" : ", 0.015") + "]\n";
}

TEST_F(SimProgram, AStoppedOffLineRunGoesOnAsIfItHadNot) {
  const auto whole = write("whole.toml", swayed_block(false)),
             half = write("half.toml", swayed_block(true));
  const auto fem = [&](const std::string& scenario, const char* out,
                       const std::vector<std::string>& more = {}) {
    std::vector<std::string> all{scenario, "--solver", "fem",  "--elements",
                                 "linear", "--out",    at(out)};
    all.insert(all.end(), more.begin(), more.end());
    return run(all);
  };
  ASSERT_EQ(fem(whole, "a"), 0) << log();
  ASSERT_EQ(fem(half, "b"), 0) << log();
  const auto state = write("half.state", read(folder_ / "b" / "fem.state"));
  const std::vector<std::string> resume{"--resume", state};
  ASSERT_EQ(fem(whole, "b", resume), 0) << log();
  const auto rows = read(folder_ / "b" / "probes-from-step-11.csv");
  EXPECT_EQ(std::count(rows.begin(), rows.end(), '\n'), 11) << rows;
  EXPECT_EQ(read(folder_ / "a" / "probes.csv"),
            read(folder_ / "b" / "probes.csv") + rows.substr(rows.find('\n') + 1));
  for (const char* field : {"field_0000000ms.csv", "field_0000005ms.csv", "field_0000015ms.csv"})
    EXPECT_EQ(read(folder_ / "a" / field), read(folder_ / "b" / field)) << field;
  EXPECT_EQ(read(folder_ / "a" / "fem.state"), read(folder_ / "b" / "fem.state"));

  const auto refused = [&](const std::string& scenario, std::vector<std::string> more,
                           const char* says) {
    more.insert(more.end(), resume.begin(), resume.end());
    EXPECT_EQ(fem(scenario, "b", more), 3) << log();
    EXPECT_NE(log().find(says), std::string::npos) << log();
    const std::string line = log();
    EXPECT_EQ(std::count(line.begin(), line.end(), '\n'), 1) << line;
    EXPECT_EQ(read(folder_ / "b" / "probes-from-step-11.csv"), rows) << "nothing is lost";
  };
  refused(whole, {"--step-ms", "2"}, "half.state: has other steps of time");
  refused(write("other.toml", swayed_block(false, "[0.03, 0, 0]")), {}, "other loads");
  refused(whole, {"--material", "human_liver_nava2008"}, "is of another organ, material");
}

TEST_F(SimProgram, TimesOfShortStepsAreWritten) {
  const auto scenario = write("short.toml", swayed_block(true));
  ASSERT_EQ(run({scenario, "--solver", "fem", "--elements", "linear", "--step-ms", "0.4", "--out",
                 at("out")}),
            0)
      << log();
  std::istringstream lines(read(folder_ / "out" / "probes.csv"));
  std::string line;
  std::getline(lines, line);
  double before = 0;
  for (int row = 1; std::getline(lines, line); ++row, before = std::stod(line)) {
    const double steps = std::stod(line) / 0.4e-3;
    EXPECT_NEAR(steps, std::round(steps), 1e-6) << line;
    EXPECT_GT(std::stod(line), before);
  }
  EXPECT_NEAR(before, 0.01, 1e-12);
}

TEST_F(SimProgram, OptionsThatWouldDoNothingAreRefused) {
  const auto dynamic = write("dynamic.toml", swayed_block(true));
  const std::string still = std::string(TROCAR_SOURCE_DIR) + "/deploy/scenes/stretch.toml";
  const auto refused = [&](std::vector<std::string> arguments, const char* says) {
    arguments.insert(arguments.end(), {"--out", at("out")});
    EXPECT_EQ(run(arguments), 2) << log();
    const std::string line = log();
    EXPECT_NE(line.find(says), std::string::npos) << line;
    EXPECT_EQ(std::count(line.begin(), line.end(), '\n'), 1) << line;
  };
  for (const auto& [option, value] :
       {std::pair{"--material", "human_liver_nava2008"}, std::pair{"--elements", "linear"},
        std::pair{"--resume", "fem.state"}, std::pair{"--bulk-ratio", "40"},
        std::pair{"--response", "equilibrium"}, std::pair{"--step-ms", "1"}})
    refused({dynamic, option, value}, (std::string(option) + ": is of --solver fem").c_str());
  refused({dynamic, "--solver", "fem", "--plot"}, "--plot: ");
  refused({dynamic, "--solver", "fem", "--bulk-ratio", "40"}, "--bulk-ratio: ");
  refused({dynamic, "--solver", "fem", "--response", "equilibrium"}, "--response: ");
  refused({still, "--solver", "fem", "--step-ms", "1"}, "--step-ms: this run is static");
  refused({dynamic, "--solver", "fem", "--step-ms", "20"}, "--step-ms: 0.01 s are 0.5 steps");
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
  child_->signal(SIGINT);
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

constexpr const char* kCutBlock = R"([organ]
source = "block"
nodes = [9, 5, 9]
spacing_mm = 5
[material]
elastic_law = "neo-hookean"
[[tool]]
radius_mm = 1
edge_mm = 30
key = [{time_s = 0, position_mm = [-30, 2, 0], shaft = [0, 1, 0], verb = "cut"},
       {time_s = 0.2, position_mm = [30, 2, 0]}]
[[probe]]
tool = 0
quantity = "force"
[output]
fields_s = [0, 0.25]
[run]
like = "session"
seconds = 0.256
)";

TEST_F(SimProgram, AScenarioCutsAndItsJournalVerifies) {
  const auto cuts = write("cuts.toml", kCutBlock);
  const auto journal = at("cuts.mcap"), out = at("cuts");
  ASSERT_EQ(run({cuts, "--out", out, "--journal", journal}), 0) << log();
  const auto before = read(folder_ / "cuts" / "field_0000000ms.csv"),
             after = read(folder_ / "cuts" / "field_0000250ms.csv");
  // The blade goes along the middle plane of the block and parts its nine columns of nodes there.
  EXPECT_GE(std::count(after.begin(), after.end(), '\n'),
            std::count(before.begin(), before.end(), '\n') + 9);
  EXPECT_EQ(run({cuts, "--out", out, "--journal", journal}), 3) << "a journal is never overwritten";
  ASSERT_EQ(std::system((std::string(TROCAR_BINARY_DIR) + "/trocar-journal verify " + journal +
                         " > " + at("verify.log") + " 2>&1")
                            .c_str()),
            0)
      << read(folder_ / "verify.log");

  // The same hands on the same organ are the same session; on another they are not.
  ASSERT_EQ(run({"--hands", journal, "--out", at("same"), "--journal", at("same.mcap")}), 0)
      << log();
  EXPECT_EQ(read(folder_ / "same" / "field_0000256ms.csv").empty(), false);
  ASSERT_EQ(run({"--hands", journal, "--organ", "liver", "--out", at("other")}), 0) << log();
  EXPECT_NE(log().find("256 ticks of its hands on liver"), std::string::npos) << log();
}

TEST_F(SimProgram, TissueTearsInAScenario) {
  const auto tears =
      write("tears.toml",
            "[organ]\nsource = \"block\"\nnodes = [5, 9, 5]\nspacing_mm = 5\n"
            "[material]\nelastic_law = \"neo-hookean\"\ntear_stretch = 1.3\n"
            "[[nodes]]\nname = \"top\"\nbox_min_mm = [-10, 20, -10]\nbox_max_mm = "
            "[10, 20, 10]\n[[displace]]\nset = \"top\"\n[[displace.key]]\ntime_s = "
            "0\ndisplacement_mm = [0, 0, 0]\n[[displace.key]]\ntime_s = "
            "0.3\ndisplacement_mm = [0, 40, 0]\n[[probe]]\nset = \"top\"\nquantity = "
            "\"reaction\"\n[run]\nseconds = 0.4\n[output]\nfields_s = [0, 0.4]\n");
  ASSERT_EQ(run({tears, "--out", at("tears")}), 0) << log();
  const auto before = read(folder_ / "tears" / "field_0000000ms.csv"),
             after = read(folder_ / "tears" / "field_0000400ms.csv");
  EXPECT_GT(std::count(after.begin(), after.end(), '\n'),
            std::count(before.begin(), before.end(), '\n'));
}

TEST_F(SimProgram, TetsThatAreInsideOutAreSaid) {
  const std::string block = "[organ]\nsource = \"block\"\nnodes = [5, 5, 5]\nspacing_mm = 8\n";
  const std::string hangs = "[gravity]\nm_s2 = [0, -9.81, 0]\n[run]\nseconds = 0.01\n";
  const auto soft = write("soft.toml", block + "[material]\nyoung_modulus_pa = 50\n" + hangs +
                                           "start = \"equilibrium\"\n"),
             firm = write("firm.toml", block + hangs + "start = \"equilibrium\"\n");
  ASSERT_EQ(run({soft, "--out", at("soft")}), 0) << log();
  EXPECT_NE(log().find("tets are inside out, first seen at 0.000 s"), std::string::npos) << log();
  ASSERT_EQ(run({firm, "--out", at("firm")}), 0) << log();
  EXPECT_EQ(log().find("inside out"), std::string::npos) << log();
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
