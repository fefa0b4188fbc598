#pragma once

// A program of ours as a process, in a folder of the test's own that goes when the test ends.
// Output and errors go to one log.

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "common/process/process.h"

namespace trocar::testing {

class ProgramFixture : public ::testing::Test {
 protected:
  explicit ProgramFixture(std::string program) : program_(std::move(program)) {
    std::filesystem::create_directories(folder_);
  }
  ~ProgramFixture() override {
    child_.reset();
    std::filesystem::remove_all(folder_);
  }

  void start(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), TROCAR_BINARY_DIR "/" + program_);
    const std::ofstream emptied(folder_ / "log");
    auto child = process::Child::start({.words = std::move(arguments), .log = folder_ / "log"});
    ASSERT_TRUE(child) << child.error().message;
    child_.emplace(std::move(*child));
  }
  int wait() {
    const auto ending = child_->wait();
    return ending.exit_code.value_or(128 + ending.signal);
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
  std::optional<process::Child> child_;
};

}  // namespace trocar::testing
