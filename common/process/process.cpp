#include "common/process/process.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <thread>
#include <utility>

#include "common/base/own_folder.h"

namespace trocar::process {
namespace {

std::vector<char*> pointers_to(const std::vector<std::string>& words) {
  std::vector<char*> pointers;
  for (const auto& word : words) pointers.push_back(const_cast<char*>(word.c_str()));
  pointers.push_back(nullptr);
  return pointers;
}

Error not_started(const std::string& program, int reason) {
  return {ErrorCode::ResourceMissing,
          program + ": cannot be started (" + std::strerror(reason) + ")"};
}

struct Settings {
  posix_spawn_file_actions_t files{};
  posix_spawnattr_t attributes{};
  int failed = 0;

  explicit Settings(const Command& command) {
    posix_spawn_file_actions_init(&files);
    give(command.in, 0);
    if (command.log.empty()) {
      give(command.out, 1);
      give(command.errors, 2);
    } else {
      posix_spawn_file_actions_addopen(&files, 1, command.log.c_str(),
                                       O_WRONLY | O_CREAT | O_APPEND, 0600);
      give(1, 2);
    }
    if (command.more != kNothing) give(command.more, 3);
    posix_spawn_file_actions_addclosefrom_np(&files, command.more == kNothing ? 3 : 4);
    sigset_t none, pipe;
    sigemptyset(&none);
    sigemptyset(&pipe);
    sigaddset(&pipe, SIGPIPE);
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setsigdefault(&attributes, &pipe);
    const int apart = command.is_apart ? POSIX_SPAWN_SETSID : 0;
    posix_spawnattr_setflags(
        &attributes, static_cast<short>(POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | apart));
  }
  ~Settings() {
    posix_spawn_file_actions_destroy(&files);
    posix_spawnattr_destroy(&attributes);
  }
  Settings(const Settings&) = delete;
  Settings& operator=(const Settings&) = delete;

  void give(int ours, int number) {
    const int refused =
        ours == kNothing ? posix_spawn_file_actions_addopen(&files, number, "/dev/null", O_RDWR, 0)
                         : posix_spawn_file_actions_adddup2(&files, ours, number);
    if (refused != 0) failed = refused;
  }
};

}  // namespace

Result<Child> Child::start(const Command& command) {
  const auto words = pointers_to(command.words);
  const Settings settings(command);
  pid_t pid = 0;
  int failed = settings.failed;
  if (failed == 0)
    failed = ::posix_spawnp(&pid, words.front(), &settings.files, &settings.attributes,
                            words.data(), environ);
  if (failed != 0) return not_started(command.words.front(), failed);
  return Child(pid);
}

Child::Child(Child&& other) noexcept
    : pid_(std::exchange(other.pid_, 0)), ending_(std::exchange(other.ending_, {})) {}

Child& Child::operator=(Child&& other) noexcept {
  std::swap(pid_, other.pid_);
  std::swap(ending_, other.ending_);
  return *this;
}

Child::~Child() {
  signal(SIGKILL);
  wait();
}

void Child::look(int options) {
  if (pid_ == 0 || ending_) return;
  int status = 0;
  const pid_t got = ::waitpid(pid_, &status, options);
  if (got == pid_ && WIFEXITED(status))
    ending_ = Ending{.exit_code = WEXITSTATUS(status), .signal = 0};
  else if (got == pid_)
    ending_ = Ending{.exit_code = std::nullopt, .signal = WTERMSIG(status)};
  else if (got < 0 && errno != EINTR)
    ending_ = Ending{};
}

std::optional<Ending> Child::poll() {
  look(WNOHANG);
  return ending_;
}

Ending Child::wait() {
  while (pid_ != 0 && !ending_) look(0);
  return ending_.value_or(Ending{});
}

void Child::signal(int number) const {
  if (pid_ != 0 && !ending_) ::kill(pid_, number);
}

void Child::stop(std::chrono::milliseconds grace) {
  signal(SIGTERM);
  const auto until = std::chrono::steady_clock::now() + grace;
  while (!poll() && std::chrono::steady_clock::now() < until)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  signal(SIGKILL);
  wait();
}

std::string find_program(const std::string& name) {
  std::error_code ignored;
  const auto beside = own_folder() / name;
  return std::filesystem::exists(beside, ignored) ? beside.string() : name;
}

Error become(const std::vector<std::string>& words) {
  ::execv(words.front().c_str(), pointers_to(words).data());
  return not_started(words.front(), errno);
}

}  // namespace trocar::process
