// The configuration file of trocar-server is read and checked here, with the program itself.

#include <gtest/gtest.h>

#include <regex>
#include <set>

#include "server/app/server/options.h"
#include "tests/support/program_fixture.h"

namespace trocar::testing {
namespace {

constexpr const char* kExample = TROCAR_SOURCE_DIR "/deploy/trocar-server.toml.example";

class ServerConfig : public ProgramFixture {
 protected:
  ServerConfig() : ProgramFixture("trocar-server") {}

  // The exit code of a check of this text; the log has what it says.
  int check(const std::string& text, std::vector<std::string> more = {}) {
    more.insert(more.begin(),
                {"--config", write("lesson.toml", text), "--check-config", "--state", at("state")});
    return run(more);
  }
  void expect_fault(const std::string& text, const std::string& where, const std::string& says) {
    EXPECT_EQ(check(text), 2) << text;
    expect_line(at("lesson.toml") + where);
    expect_line(says);
  }
  // Parses as the program does.
  static Result<std::optional<app::ServerOptions>> parse(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "trocar-server");
    std::vector<char*> argv;
    for (auto& argument : arguments) argv.push_back(argument.data());
    return app::parse_command_line(static_cast<int>(argv.size()), argv.data());
  }
};

std::set<std::string> matches(const std::string& text, const std::string& pattern) {
  const std::regex regex(pattern, std::regex::multiline);
  std::set<std::string> found;
  for (std::sregex_iterator it(text.begin(), text.end(), regex), end; it != end; ++it)
    found.insert((*it)[1]);
  return found;
}

TEST_F(ServerConfig, TheExampleHasEveryOption) {
  ASSERT_EQ(run({"--help"}), 0);
  const std::string help = log();
  auto options = matches(help.substr(0, help.find("\nExamples:")), "^ +(?:-h,)?--([a-z-]+)");
  for (const auto* option : {"help", "version", "config", "check-config"})
    EXPECT_EQ(options.erase(option), 1u) << option;
  EXPECT_GT(options.size(), 25u);
  EXPECT_EQ(matches(read(kExample), "^(?:# )?([a-z-]+) = "), options);
}

TEST_F(ServerConfig, TheExampleExplainsEachKeyAboveIt) {
  std::istringstream lines(read(kExample));
  const std::regex key("(# )?[a-z-]+ = .*");
  std::string before;
  int keys = 0;
  for (std::string line; std::getline(lines, line); before = line) {
    if (!std::regex_match(line, key)) continue;
    ++keys;
    EXPECT_TRUE(before.starts_with("# ") && before.ends_with(".")) << line;
    EXPECT_FALSE(std::regex_match(before, key)) << line;
  }
  EXPECT_GT(keys, 25);
}

TEST_F(ServerConfig, TheExampleIsFineAndStartsAServer) {
  EXPECT_EQ(run({"--config", kExample, "--check-config", "--state", at("state")}), 0) << log();
  EXPECT_EQ(log(), std::string(kExample) + ": fine\n");
  EXPECT_FALSE(std::filesystem::exists(at("state"))) << "a check makes nothing";
  EXPECT_EQ(run({"--config", kExample, "--organ", "lattice", "--listen", "127.0.0.1:0", "--journal",
                 "none", "--state", at("state"), "--seconds", "0.1", "--summary", at("summary")}),
            0)
      << log();
  EXPECT_NE(read(at("summary")).find("\"lattice\""), std::string::npos) << "the command line wins";
}

TEST_F(ServerConfig, TheExampleMayBeUsedInFull) {
  const auto all = std::regex_replace(read(kExample),
                                      std::regex("^# ([a-z-]+ = )", std::regex::multiline), "$1");
  const auto options = parse({"--config", write("all.toml", all)});
  ASSERT_TRUE(options) << options.error().message;
  EXPECT_EQ((*options)->journal, "lesson.mcap");
  EXPECT_EQ((*options)->seconds, 2700);
  EXPECT_EQ((*options)->access.certificate_file, "server.pem");
  EXPECT_EQ((*options)->access.revoke, "observer");
  EXPECT_EQ((*options)->access.new_code, "observer");
  EXPECT_EQ((*options)->limits.places.watchers, 100);
}

TEST_F(ServerConfig, AKeyToSignWithIsReadBeforeTheSession) {
  const auto missing = at("missing.pem"), text = write("text.pem", "no key\n");
  expect_fault("sign = '" + missing + "'\n", ":1: key sign: ", "cannot be read");
  expect_fault("sign = '" + text + "'\n",
               ":1: key sign: ", "is no private Ed25519 key in PEM form");
  expect_fault("journal = 'none'\nsign = '" + text + "'\n", ":2: key sign: ", "nothing to sign");
  EXPECT_EQ(run({"--journal", at("new.mcap"), "--sign", text, "--listen", "127.0.0.1:0"}), 3);
  EXPECT_FALSE(std::filesystem::exists(at("new.mcap")));
}

TEST_F(ServerConfig, ValuesAreThoseOfTheFileUnlessTheyAreTyped) {
  const auto file = write("a.toml",
                          "organ = 'plate'\nlisten = \"[::1]:9\"\nkeep-codes = true # really\n"
                          "frozen = true\nbudget = 0.6\nsweeps = 6\nworkers = 2\ncode-hours = 3\n");
  const auto from_file = parse({"--config", file});
  ASSERT_TRUE(from_file) << from_file.error().message;
  const auto& options = **from_file;
  EXPECT_EQ(options.organ, "plate");
  EXPECT_EQ(options.address, "::1");
  EXPECT_EQ(options.port, 9);
  EXPECT_TRUE(options.access.keeps_codes);
  EXPECT_EQ(options.decisions.boundary, world::Boundary::Frozen);
  EXPECT_EQ(options.decisions.depth_limit, step::kFrozenDepthLimit);
  EXPECT_EQ(options.decisions.sweeps, 6u);
  EXPECT_EQ(options.budget_ms, 0.6);
  EXPECT_EQ(options.workers, 2u);
  EXPECT_EQ(options.access.code_hours, 3);
  const auto typed =
      parse({"--config", file, "--organ", "chest", "--sweeps", "5", "--keep-codes=false"});
  ASSERT_TRUE(typed) << typed.error().message;
  EXPECT_EQ((*typed)->organ, "chest");
  EXPECT_EQ((*typed)->decisions.sweeps, 5u);
  EXPECT_FALSE((*typed)->access.keeps_codes);
  EXPECT_EQ((*typed)->workers, 2u);
}

TEST_F(ServerConfig, FaultsNameFileLineKeyAndLimit) {
  expect_fault("organ = 'lattice'\norgann = 1\n", ":2: key organn: ", "is unknown");
  expect_fault("\n\nbudget = 3\n", ":3: key budget: ", "3 is not a number from 0.05 to 1");
  expect_fault("sweeps = 65\n", ":1: key sweeps: ", "65 is outside 1 to 64");
  expect_fault("omega = 2.5\n", ":1: key omega: ", "outside 1 to 1.9");
  expect_fault("code-hours = 0\n", ":1: key code-hours: ", "0 is not a number from 0.01 to 8760");
  expect_fault("seconds = nan\n", ":1: key seconds: ", "plain number");
  expect_fault("workers = 1.5\n", ":1: key workers: ", "1.5");
  expect_fault("workers = true\n", ":1: key workers: ", "plain number");
  expect_fault("frozen = 1\n", ":1: key frozen: ", "true or false");
  expect_fault("listen = 'nowhere'\n", ":1: key listen: ", "ADDRESS:PORT");
  expect_fault("listen = 'nowhere:1'\n", ":1: key listen: ", "not an IPv4 or IPv6 address");
  expect_fault("log-level = 'loud'\n", ":1: key log-level: ", "loud");
  expect_fault("config = 'other.toml'\n", ":1: key config: ", "command line");
  expect_fault("[access]\ncode-hours = 1\n", ":1: key access: ", "is unknown");
  expect_fault("organ = 'lattice'\norgan = 'liver'\n", ":2: ", "is not TOML");
  expect_fault("organ lattice\n", ":1: ", "is not TOML");
  expect_fault("[&", ": ", "is not TOML");
}

TEST_F(ServerConfig, ASummaryThatCouldNotBeWrittenIsFoundAtTheStart) {
  EXPECT_EQ(run({"--organ", "lattice", "--listen", "127.0.0.1:0", "--journal", "none", "--state",
                 at("state"), "--seconds", "0.1", "--summary", at("none/s.json")}),
            5);
  expect_line("none/s.json: cannot be written, its folder is not there");
  const auto kept = write("kept.mcap", "\x89MCAP0\r\n");
  EXPECT_EQ(run({"--organ", "lattice", "--listen", "127.0.0.1:0", "--journal", "none", "--state",
                 at("state"), "--seconds", "0.1", "--summary", kept}),
            2);
  expect_line("--summary: " + kept + " is a recording, which would be lost");
  EXPECT_FALSE(std::filesystem::exists(at("state")));
}

TEST_F(ServerConfig, FaultsOfFilesAndCombinationsAreFound) {
  const std::string lattice = "organ = 'lattice'\n";
  expect_fault("organ = '/no/such.organ'\n", ":1: key organ: ", "/no/such.organ");
  expect_fault("organ = 'heart'\n", ":1: key organ: ", "is no built-in organ");
  expect_fault(lattice + "averaged-strain = true\n", ":2: key averaged-strain: ", "");
  expect_fault("certificate = 'server.pem'\n", ":1: key certificate: ", "requires --key");
  expect_fault("certificate = '/no/c.pem'\nkey = '/no/k.pem'\n",
               ":1: key certificate: ", "/no/c.pem");
  expect_fault("insecure-loopback = true\nlisten = '0.0.0.0:0'\n",
               ":1: key insecure-loopback: ", "can be reached");
  expect_fault(lattice + "journal = '" + write("old.mcap", "") + "'\n",
               ":2: key journal: ", "exists already");
  expect_fault(lattice + "summary = '/no/folder/summary.json'\n",
               ":2: key summary: ", "its folder is not there");
  expect_fault(lattice + "audit = '/no/folder/audit.jsonl'\n", ":2: key audit: ", "/no/folder");
  expect_fault(lattice + "revoke = 'observer'\n", ":2: key revoke: ", "no session");
  EXPECT_EQ(check(lattice, {"--organ", "/no/such.organ"}), 2);
  expect_line("--organ: /no/such.organ");
  EXPECT_EQ(run({"--config", at("none.toml"), "--check-config"}), 2);
  expect_line("--config: ");
  EXPECT_EQ(run({"--check-config"}), 2);
  expect_line("requires --config");
}

TEST_F(ServerConfig, AStartSaysWhereAFaultIs) {
  EXPECT_EQ(run({"--config", write("lesson.toml", "budget = 3\n")}), 2);
  expect_line(at("lesson.toml") + ":1: key budget: ");
  EXPECT_EQ(run({"--budget", "nan"}), 2);
  expect_line("--budget: nan is not a number from 0.05 to 1");
}

}  // namespace
}  // namespace trocar::testing
