#include "tests/support/child_program.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <thread>

extern char** environ;

namespace trocar::testing {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
constexpr int kNotStarted = 127 << 8;  // as a shell says it, in the form of waitpid()

}  // namespace

Program::Program(const std::string& name, const std::vector<std::string>& arguments,
                 const fs::path& log) {
  const std::string path = TROCAR_BINARY_DIR "/" + name;
  std::vector<char*> argv{const_cast<char*>(path.c_str())};
  for (const auto& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 1, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  posix_spawn_file_actions_adddup2(&actions, 1, 2);
  const int failed = posix_spawn(&pid_, path.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  has_ended_ = failed != 0;
  if (has_ended_) status_ = kNotStarted;
}

Program::Program(Program&& other) noexcept
    : pid_(other.pid_), status_(other.status_), has_ended_(other.has_ended_) {
  other.has_ended_ = true;
}

Program::~Program() {
  if (has_ended_) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
}

void Program::signal(int number) const {
  kill(pid_, number);
}

bool Program::is_running() {
  if (!has_ended_ && waitpid(pid_, &status_, WNOHANG) == pid_) has_ended_ = true;
  return !has_ended_;
}

int Program::wait(double seconds) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (is_running()) {
    if (std::chrono::steady_clock::now() > end) return -1;
    std::this_thread::sleep_for(milliseconds(10));
  }
  return WIFEXITED(status_) ? WEXITSTATUS(status_) : 128 + WTERMSIG(status_);
}

}  // namespace trocar::testing
