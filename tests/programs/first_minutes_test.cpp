// Tests what a new user meets in the first five minutes: help, an import with the wrong unit, a
// client that is started before its server, an example that is at rest.

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <thread>

#include "tests/support/program_fixture.h"

namespace trocar {
namespace {

class Organ : public testing::ProgramFixture {
 protected:
  Organ() : ProgramFixture("trocar-organ") {}

  // A cube of six tets, with an edge of `edge` and one corner at (edge, 0, 0).
  std::string cube(double edge) const {
    std::string text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n";
    for (int i = 0; i < 8; ++i)
      text += std::to_string(i + 1) + " " + std::to_string(edge * (1 + (i & 1))) + " " +
              std::to_string(edge * (i >> 1 & 1)) + " " + std::to_string(edge * (i >> 2)) + "\n";
    text += "$EndNodes\n$Elements\n6\n";
    // Each tet goes from corner 1 to corner 8 by two steps along different axes.
    const char* const kTets[] = {"1 2 4 8", "1 4 3 8", "1 3 7 8", "1 7 5 8", "1 5 6 8", "1 6 2 8"};
    for (int i = 0; i < 6; ++i) text += std::to_string(i + 1) + " 4 2 0 0 " + kTets[i] + "\n";
    return write("cube.msh", text + "$EndElements\n");
  }
  bool log_has(const std::string& text) const { return log().find(text) != std::string::npos; }
};

TEST_F(Organ, OfTheWrongUnitIsNamedWithItsSizeAndWhatToDo) {
  const auto file = cube(0.1);
  ASSERT_EQ(run({"import", file, "--unit", "mm", "--out", at("cube.organ")}), 0) << log();
  EXPECT_TRUE(
      log_has("the organ is only 0.1 x 0.1 x 0.1 mm with --unit mm: with trocar-organ import "
              "--unit m it would be 100 mm long"))
      << log();
  ASSERT_EQ(run({"import", file, "--out", at("cube.organ")}), 0) << log();
  EXPECT_FALSE(log_has("is only")) << log();
}

TEST_F(Organ, IsOfTheLawThatIsAskedForAndOtherwiseSaysWhatItIs) {
  const auto file = cube(0.1), out = at("cube.organ");
  ASSERT_EQ(run({"import", file, "--out", out}), 0) << log();
  EXPECT_TRUE(log_has("chosen, as nothing was asked for: springs, Young's modulus 4 kPa")) << log();
  ASSERT_EQ(run({"import", file, "--law", "neo-hookean", "--young-modulus", "6000", "--out", out}),
            0)
      << log();
  EXPECT_FALSE(log_has("chosen")) << log();
  EXPECT_TRUE(log_has("neo-hookean, Young's modulus 6 kPa, Poisson's ratio 0.45")) << log();
  ASSERT_EQ(run({"import", file, "--law", "tensor-mass", "--poisson-ratio", "0.3", "--out", out}),
            0)
      << log();
  EXPECT_TRUE(log_has("chosen, as nothing was asked for: Young's modulus 4 kPa")) << log();
  EXPECT_TRUE(log_has("tensor-mass, Young's modulus 4 kPa, Poisson's ratio 0.3")) << log();
}

TEST_F(Organ, RefusesWhatDoesNotGoTogether) {
  const auto file = cube(0.1), out = at("cube.organ");
  EXPECT_EQ(run({"import", file, "--law", "rubber", "--out", out}), 2);
  EXPECT_EQ(run({"import", file, "--poisson-ratio", "0.3", "--out", out}), 2);
  expect_line("springs have 1/4");
  EXPECT_EQ(run({"import", file, "--law", "neo-hookean", "--poisson-ratio", "0.5", "--out", out}),
            2);
  expect_line("");
  EXPECT_EQ(run({"import", file, "--law", "neo-hookean", "--young-modulus", "-1", "--out", out}),
            2);
  expect_line("");
  EXPECT_EQ(
      run({"import", file, "--material", "human_liver_nava2008", "--law", "springs", "--out", out}),
      2);
  expect_line("remove --law");
  EXPECT_FALSE(std::filesystem::exists(out));
}

TEST_F(Organ, ShowsHowFarItsOriginIsFromTheFiles) {
  ASSERT_EQ(run({"import", cube(0.1), "--out", at("cube.organ")}), 0) << log();
  ASSERT_EQ(run({"inspect", at("cube.organ")}), 0) << log();
  EXPECT_TRUE(log_has("offset              150 50 50 mm")) << log();
}

TEST_F(Organ, WritesNoProgressIntoAFile) {
  ASSERT_EQ(run({"import", cube(0.1), "--law", "neo-hookean", "--young-modulus", "6000", "--out",
                 at("cube.organ")}),
            0)
      << log();
  ASSERT_EQ(run({"reduce", at("cube.organ"), "--modes", "2", "--places", "2", "-o",
                 at("cube.reduction"), "--results", at("results")}),
            0)
      << log();
  EXPECT_FALSE(log_has(" s to go")) << log();
  EXPECT_FALSE(log_has("\r")) << log();
}

TEST_F(Organ, IsListedByTheNamesThatMakeTakes) {
  ASSERT_EQ(run({"list"}), 0) << log();
  EXPECT_TRUE(log_has("elastic-liver  of neo-Hookean tets")) << log();
  EXPECT_EQ(run({"make", "spleen"}), 2);
  expect_line("'spleen' is no built-in organ. There are liver, elastic-liver, ");
  expect_line("trocar-organ import FILE makes an organ");
  EXPECT_EQ(run({"make", "livr"}), 2);
  expect_line("'livr' is no built-in organ, did you mean liver?");
}

TEST_F(Organ, SaysWhatWasProbablyMeant) {
  EXPECT_EQ(run({"mkae", "liver"}), 2);
  expect_line("mkae: is no command of trocar-organ, did you mean make? (see trocar-organ --help)");
  EXPECT_EQ(run({"make", "liver", "--tet", "9"}), 2);
  expect_line(
      "--tet: is no option of trocar-organ make, did you mean --tets? (see trocar-organ make "
      "--help)");
  EXPECT_EQ(run({}), 2);
  expect_line("a command is missing, choose one of make, list, import");
  EXPECT_EQ(run({"make"}), 2);
  expect_line("NAME: is missing, give it");
  EXPECT_EQ(run({"import", "cube.msh", "--nodes", "many"}), 2);
  expect_line("--nodes: 'many' is not a number");
  EXPECT_EQ(run({"make", "liver", "--out"}), 2);
  expect_line("--out: has no value, give one");
}

TEST_F(Organ, HelpOfACommandHasItsOwnExamples) {
  ASSERT_EQ(run({"settle", "--help"}), 0);
  EXPECT_TRUE(log_has("Examples:\n  trocar-organ settle spleen.organ")) << log();
  EXPECT_TRUE(log_has("into spleen-settled.organ")) << log();
  EXPECT_FALSE(log_has("trocar-organ fit")) << log();
}

class Journal : public testing::ProgramFixture {
 protected:
  Journal() : ProgramFixture("trocar-journal") {}
};

TEST_F(Journal, ListsItsCommandsForOneThatNobodyCouldMean) {
  EXPECT_EQ(run({"show", "session.mcap"}), 2);
  expect_line("show: is no command of trocar-journal, choose one of info, verify");
}

class Server : public testing::ProgramFixture {
 protected:
  Server() : ProgramFixture("trocar-server") {}
};

TEST_F(Server, SaysWhichLessonOptionOrWordWasMeant) {
  EXPECT_EQ(run({"--lesson", "find-the-lmup"}), 2);
  expect_line("there is no lesson \"find-the-lmup\", did you mean find-the-lump?");
  EXPECT_EQ(run({"--max-watcher", "3"}), 2);
  expect_line("--max-watcher: is no option of trocar-server, did you mean --max-watchers?");
  EXPECT_EQ(run({"--log-level", "wran"}), 2);
  expect_line("--log-level: wran is none of error, warn, info, debug, off, did you mean warn?");
  EXPECT_EQ(run({"--max-hands", "3.5"}), 2);
  expect_line("--max-hands: 3.5 is not a whole number from 1 to ");
  EXPECT_EQ(run({"--organ", "stomac", "--journal", "none"}), 3);
  expect_line("'stomac' is no built-in organ, did you mean stomach?");
}

TEST_F(Server, HelpShowsNothingOfTheLibraryThatReadsOptions) {
  ASSERT_EQ(run({"--help"}), 0);
  const auto help = log();
  for (const char* leak : {"Option Group", "UINT", "INT in", " in [", "REQUIRED", "Needs:"})
    EXPECT_EQ(help.find(leak), std::string::npos) << leak << "\n" << help;
  EXPECT_NE(help.find("\nAccess, who may join:\n"), std::string::npos) << help;
  EXPECT_NE(help.find("--max-newcomers N (4 to 1000)"), std::string::npos) << help;
}

TEST_F(Server, HelpHasTheTrainersOptionsFirstAndTheSolversLast) {
  ASSERT_EQ(run({"--help"}), 0);
  const auto help = log();
  const auto research = help.find("Research");
  ASSERT_NE(research, std::string::npos) << help;
  for (const char* option : {"--help", "--version", "--organ", "--listen", "--journal", "--seconds",
                             "--summary", "--workers", "--log-level"})
    EXPECT_LT(help.find(option), research) << option;
  for (const char* option :
       {"--averaged-strain", "--frozen", "--fixed-decisions", "--budget", "--depth", "--nodes",
        "--sweeps", "--omega", "--far-sweeps", "--exact-far", "--ready-file"}) {
    const auto place = help.find(std::string("  ") + option + " ");
    EXPECT_TRUE(place != std::string::npos && place > research) << option;
  }
}

class Client : public testing::ProgramFixture {
 protected:
  Client() : ProgramFixture("trocar-client") {}

  // Nobody listens there, and nobody is given this port who asks for any.
  static std::string free_address() {
    for (int port = 20'000 + getpid() % 10'000;; ++port) {
      sockaddr_in address{};
      address.sin_family = AF_INET;
      address.sin_port = htons(static_cast<std::uint16_t>(port));
      address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
      const bool is_free =
          ::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
      ::close(socket);
      if (is_free) return "127.0.0.1:" + std::to_string(port);
    }
  }
};

class SecondProgram : public testing::ProgramFixture {
 public:
  explicit SecondProgram(const std::string& program) : ProgramFixture(program) {}
  void TestBody() override {}
  using ProgramFixture::start;
  using ProgramFixture::wait;
};

TEST_F(Client, WaitsForAServerThatIsStartedAfterIt) {
  const std::string address = free_address();
  start(
      {"--server", address, "--no-render", "--name", "Early", "--wait", "60", "--seconds", "0.2"});
  // It has tried and said so before there is a server.
  for (int i = 0; i < 1000 && log().find("yet") == std::string::npos; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_NE(log().find("no server at " + address + " yet"), std::string::npos) << log();
  SecondProgram server("trocar-server");
  server.start({"--organ", "elastic-liver", "--listen", address, "--journal", "none", "--log-level",
                "error"});
  EXPECT_EQ(wait(), 0);
}

TEST_F(Client, SaysWhichRoleOrOptionWasMeant) {
  EXPECT_EQ(run({"--rol", "observer"}), 2);
  expect_line(
      "--rol: is no option of trocar-client, did you mean --role? (see trocar-client --help)");
  EXPECT_EQ(run({"--role", "surgoen"}), 2);
  expect_line("surgoen is none of surgeon, ");
  expect_line("did you mean surgeon?");
}

TEST_F(Client, SaysThatNoMachineHasThisName) {
  EXPECT_EQ(run({"--server", "nobody.invalid:7690", "--join", "7K3M-9QXZ-4T2B-WN8C", "--no-render",
                 "--name", "Alone", "--wait", "0.1"}),
            5);
  EXPECT_NE(log().find("no server at nobody.invalid:7690 (no machine is known by this name): check "
                       "how it is spelt"),
            std::string::npos)
      << log();
}

TEST_F(Client, GivesUpAfterTheTimeThatItWasGiven) {
  EXPECT_EQ(run({"--server", free_address(), "--no-render", "--name", "Alone", "--wait", "0.3"}),
            5);
  EXPECT_NE(log().find("start trocar-server"), std::string::npos) << log();
}

class Sim : public testing::ProgramFixture {
 protected:
  Sim() : ProgramFixture("trocar-sim") {}
};

TEST_F(Sim, SaysWhatTakesAScriptOfHands) {
  EXPECT_EQ(run({std::string(TROCAR_SOURCE_DIR) + "/deploy/scenes/lift.toml"}), 3);
  expect_line("give it to trocar-client --script");
}

// The example hangs at rest before it is pulled: at first the held nodes bear exactly its weight,
// and nothing rings.
TEST_F(Sim, TheFirstExampleStartsInEquilibrium) {
  std::string text = read(std::string(TROCAR_SOURCE_DIR) + "/deploy/scenes/pull.toml");
  ASSERT_NE(text.find("seconds = 1.5"), std::string::npos);
  text.replace(text.find("seconds = 1.5"), 13, "seconds = 0.1");
  text.replace(text.find("fields_s = [0.5, 1.5]"), 21, "fields_s = []");
  // Without the pull only gravity acts.
  text.replace(text.find("displacement_mm = [0, 5, 0]"), 27, "displacement_mm = [0, 0, 0]");
  const auto file = write("pull.toml", text);
  ASSERT_EQ(run({file, "--out", at("out")}), 0) << log();
  std::istringstream rows(read(folder_ / "out" / "probes.csv"));
  std::string line;
  std::getline(rows, line);
  std::vector<std::string> names;
  std::istringstream header(line);
  for (std::string name; std::getline(header, name, ',');) names.push_back(name);
  std::vector<std::vector<double>> table;
  while (std::getline(rows, line)) {
    table.emplace_back();
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');)
      table.back().push_back(cell.empty() ? NAN : std::stod(cell));
  }
  ASSERT_GE(table.size(), 10u);
  bool is_found = false;
  for (std::size_t column = 0; column < names.size(); ++column) {
    if (names[column].find("middle_displacement_y") == std::string::npos) continue;
    is_found = true;
    // The start leaves at most tolerance_n (1e-5 N) at each of 405 free nodes; over the stiffness
    // E A / L of the block, 4000 Pa x 80 mm x 80 mm / 60 mm, that is 9.5 um. From rest it sinks by
    // 0.4 mm and swings.
    constexpr double kBound_mm = 1e3 * 405 * 1e-5 / (4000 * 0.08 * 0.08 / 0.06);
    double at_first = NAN;  // in the first row that has it: probes have their own rates
    for (const auto& row : table) {
      if (std::isnan(at_first)) at_first = row[column];
      if (!std::isnan(row[column])) {
        EXPECT_NEAR(row[column], at_first, kBound_mm);
      }
    }
  }
  EXPECT_TRUE(is_found) << line;
}

}  // namespace
}  // namespace trocar
