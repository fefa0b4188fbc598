#include "tests/support/child_program.h"

#include <chrono>
#include <fstream>
#include <thread>
#include <utility>

namespace trocar::testing {
namespace {

constexpr int kNotStarted = 127;  // as a shell says it

}  // namespace

Program::Program(const std::string& name, const std::vector<std::string>& arguments,
                 const std::filesystem::path& log) {
  const std::ofstream emptied(log);
  process::Command command{.words = {TROCAR_BINARY_DIR "/" + name}, .log = log};
  command.words.insert(command.words.end(), arguments.begin(), arguments.end());
  if (auto child = process::Child::start(command)) child_.emplace(std::move(*child));
}

int Program::wait(double seconds) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (is_running()) {
    if (std::chrono::steady_clock::now() > end) return -1;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  if (!child_) return kNotStarted;
  const auto ending = child_->wait();
  return ending.exit_code.value_or(128 + ending.signal);
}

}  // namespace trocar::testing
