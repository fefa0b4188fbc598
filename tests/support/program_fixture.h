#pragma once

// A program of ours as a process, in a folder of the test's own that goes when the test ends.
// Output and errors go to one log.

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace trocar::testing {

class ProgramFixture : public ::testing::Test {
 protected:
  explicit ProgramFixture(std::string program) : program_(std::move(program)) {
    std::filesystem::create_directories(folder_);
  }
  ~ProgramFixture() override {
    if (pid_ > 0 && waitpid(pid_, nullptr, WNOHANG) == 0) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
    std::filesystem::remove_all(folder_);
  }

  void start(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), TROCAR_BINARY_DIR "/" + program_);
    std::vector<char*> argv;
    for (auto& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 1, (folder_ / "log").c_str(),
                                     O_WRONLY | O_CREAT | O_TRUNC, 0644);
    posix_spawn_file_actions_adddup2(&actions, 1, 2);
    ASSERT_EQ(posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), environ), 0);
    posix_spawn_file_actions_destroy(&actions);
  }
  int wait() {
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  int run(std::vector<std::string> arguments) {
    start(std::move(arguments));
    return wait();
  }

  static std::string read(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    std::ostringstream out;
    out << in.rdbuf();
    return out.str();
  }
  // Returns its path.
  std::string write(const char* name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return at(name);
  }
  std::string at(const char* name) const { return (folder_ / name).string(); }
  std::string log() const { return read(folder_ / "log"); }
  // The log is one line, which begins with the program's name.
  void expect_line(const std::string& says) const {
    const std::string line = log();
    EXPECT_TRUE(line.starts_with(program_ + ": ")) << line;
    EXPECT_EQ(std::count(line.begin(), line.end(), '\n'), 1) << line;
    EXPECT_NE(line.find(says), std::string::npos) << line;
  }

  const std::string program_;
  const std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() /
      ("trocar-program-" + std::to_string(getpid()) + "-" +
       ::testing::UnitTest::GetInstance()->current_test_info()->name());
  pid_t pid_ = -1;
};

}  // namespace trocar::testing
