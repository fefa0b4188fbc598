// Processes of the system stand in for servers: sleep and sh.

#include "server/hall/processes/server_process.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <thread>

namespace trocar::hall {
namespace {

namespace fs = std::filesystem;

class Processes : public ::testing::Test {
 protected:
  Processes() { fs::create_directories(folder_); }
  ~Processes() override { fs::remove_all(folder_); }

  ServerProcess start(const std::string& program, const std::vector<std::string>& arguments) {
    auto started = ServerProcess::start(program, arguments, log_);
    EXPECT_TRUE(started) << started.error().message;
    return std::move(*started);
  }
  static ServerProcess::Ending wait(ServerProcess& process) {
    for (int i = 0; i < 3000; ++i) {
      if (const auto ending = process.poll()) return *ending;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    ADD_FAILURE() << "it has not ended";
    return {};
  }
  const fs::path folder_ =
      fs::temp_directory_path() / ("trocar-processes-" + std::to_string(::getpid()));
  const fs::path log_ = folder_ / "log";
};

TEST_F(Processes, SaysHowOneHasEnded) {
  auto exits = start("/bin/sh", {"-c", "exit 3"});
  EXPECT_EQ(wait(exits).exit_code, 3);
  auto killed = start("/bin/sleep", {"1000"});
  EXPECT_FALSE(killed.poll());
  killed.signal(SIGKILL);
  const auto ending = wait(killed);
  EXPECT_FALSE(ending.exit_code);
  EXPECT_EQ(ending.signal, SIGKILL);
}

TEST_F(Processes, WhatCannotBeStartedIsAnError) {
  const auto started = ServerProcess::start(folder_ / "none", {}, log_);
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error().code, ErrorCode::ResourceMissing);
}

TEST_F(Processes, GoesOnWithoutWhoStartedItAndIsFoundAgain) {
  const std::vector<std::string> arguments{"1000", "1000"};
  ProcessId id;
  {
    const auto process = start("/bin/sleep", arguments);
    id = process.id();
  }
  auto found = ServerProcess::find(id, arguments);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->processor_seconds());
  EXPECT_FALSE(found->poll());
  EXPECT_FALSE(ServerProcess::find(id, {"1000"})) << "another command line";
  EXPECT_FALSE(ServerProcess::find({id.pid, id.started_at + 1}, arguments)) << "an older process";
  EXPECT_FALSE(ServerProcess::find({0, 0}, arguments));
  EXPECT_FALSE(ServerProcess::find({1, id.started_at}, arguments));
  found->signal(SIGTERM);
  const auto ending = wait(*found);
  EXPECT_FALSE(ending.exit_code) << "its exit code is another's to know";
  EXPECT_FALSE(ServerProcess::find(id, arguments)) << "it has ended, though nobody waits for it";
}

TEST_F(Processes, MeasuresProcessorTime) {
  auto busy = start("/bin/sh", {"-c", "while :; do :; done"});
  double seconds = 0;
  for (int i = 0; i < 3000 && seconds < 0.05; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    seconds = busy.processor_seconds().value_or(0);
  }
  EXPECT_GE(seconds, 0.05);
  busy.signal(SIGKILL);
  wait(busy);
  EXPECT_FALSE(busy.processor_seconds());
}

}  // namespace
}  // namespace trocar::hall
