// The program: its options, what it refuses, and that it ends as it should.

#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>

#include "server/app/impair/options.h"
#include "tests/support/program_fixture.h"

namespace trocar::app {
namespace {

using std::chrono::milliseconds;

ImpairOptions parse(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "trocar-impair");
  std::vector<char*> argv;
  for (auto& argument : arguments) argv.push_back(argument.data());
  auto options = parse_impair_command_line(static_cast<int>(argv.size()), argv.data());
  if (!options || !*options) {
    ADD_FAILURE() << (options ? "nothing to run" : options.error().message);
    return {};
  }
  return std::move(**options);
}

TEST(ImpairOptions, BothDirectionsAreAlikeUnlessOneIsTold) {
  const auto options = parse({"--delay", "30", "--loss", "5", "--down-delay", "80", "--up-rate",
                              "800", "--queue", "250", "--burst", "4"});
  const auto& [up, down] = std::tie(options.proxy.up, options.proxy.down);
  EXPECT_EQ(up.delay, milliseconds(30));
  EXPECT_EQ(down.delay, milliseconds(80));
  EXPECT_DOUBLE_EQ(up.loss, 0.05);
  EXPECT_DOUBLE_EQ(down.loss, 0.05);
  EXPECT_DOUBLE_EQ(up.rate, 100'000);
  EXPECT_DOUBLE_EQ(down.rate, 0);
  EXPECT_EQ(down.queue, milliseconds(250));
  EXPECT_DOUBLE_EQ(up.burst, 4);
  EXPECT_EQ(options.proxy.listen_port, 7700);
  EXPECT_EQ(options.proxy.server_port, 7690);
  EXPECT_EQ(options.proxy.blocked.begin, impair::kNever);
  EXPECT_EQ(options.proxy.cut.begin, impair::kNever);
}

TEST(ImpairOptions, OutagesBeginAtOnceOrLaterAndEndOrDoNot) {
  const auto at_once = parse({"--block-datagrams"}).proxy.blocked;
  EXPECT_EQ(at_once.begin, milliseconds(0));
  EXPECT_EQ(at_once.end, impair::kNever);
  const auto later = parse({"--block-datagrams", "10"}).proxy.blocked;
  EXPECT_EQ(later.begin, milliseconds(10'000));
  EXPECT_EQ(later.end, impair::kNever);
  const auto cut = parse({"--cut-stream", "1.5:0.25"}).proxy.cut;
  EXPECT_EQ(cut.begin, milliseconds(1500));
  EXPECT_EQ(cut.end, milliseconds(1750));
  for (const char* wrong : {"x", "1:", ":1", "-1", "1:2:3", "nan", "1e9", " 1"})
    EXPECT_FALSE(parse_outage("--cut-stream", wrong)) << wrong;
}

class ImpairProgram : public trocar::testing::ProgramFixture {
 protected:
  ImpairProgram() : ProgramFixture("trocar-impair") {}
};

TEST_F(ImpairProgram, WhatCannotBeIsRefusedInOneLineThatNamesTheOption) {
  struct Case {
    std::vector<std::string> arguments;
    const char* says;
  };
  const Case cases[] = {{{"--delay", "-3"}, "--delay: -3 is not a number from 0 to 10000"},
                        {{"--up-jitter", "nan"}, "--up-jitter: nan is not a number"},
                        {{"--down-loss", "95"}, "--down-loss: 95 is not a number from 0 to 90"},
                        {{"--loss", "80", "--burst", "1"}, "--burst: 1 is too short"},
                        {{"--cut-stream", "soon"}, "--cut-stream: 'soon' is not AFTER_S[:FOR_S]"},
                        {{"--listen", "7700"}, "--listen: '7700' is not ADDRESS:PORT"},
                        {{"--no-such-option"}, "--no-such-option"}};
  for (const auto& [arguments, says] : cases) {
    EXPECT_EQ(run(arguments), 2) << says;
    expect_line(says);
  }
}

TEST_F(ImpairProgram, ItEndsWithASummaryOnSigtermAndAfterItsSeconds) {
  start({"--listen", "127.0.0.1:0", "--ready-file", at("ready"), "--summary", at("summary.json"),
         "--seed", "9"});
  while (!std::filesystem::exists(folder_ / "ready")) std::this_thread::sleep_for(milliseconds(5));
  child_->signal(SIGTERM);
  EXPECT_EQ(wait(), 0) << log();
  const auto summary = nlohmann::json::parse(read(folder_ / "summary.json"));
  EXPECT_EQ(summary.at("seed"), 9);
  for (const char* direction : {"up", "down"}) {
    EXPECT_EQ(summary.at("stream").at(direction).at("passed").at("packets"), 0);
    for (const char* fate :
         {"passed", "lost", "blocked", "duplicated", "reordered", "dropped_by_queue"})
      EXPECT_EQ(summary.at("datagrams").at(direction).at(fate).at("bytes"), 0) << fate;
    EXPECT_EQ(summary.at("datagrams").at(direction).at("delay_ms").at("p99"), 0);
  }
  EXPECT_EQ(run({"--listen", "127.0.0.1:0", "--seconds", "0.05"}), 0) << log();
}

TEST_F(ImpairProgram, AFileThatCannotBeWrittenIsNamed) {
  EXPECT_EQ(run({"--listen", "127.0.0.1:0", "--seconds", "0.01", "--log-level", "error",
                 "--summary", at("no/such/folder.json")}),
            5);
  expect_line("no/such/folder.json");
}

}  // namespace
}  // namespace trocar::app
