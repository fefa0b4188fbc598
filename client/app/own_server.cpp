#include "client/app/own_server.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <thread>
#include <vector>

#include "common/base/own_folder.h"

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

constexpr int kNotStarted = 127;
constexpr auto kGrace = std::chrono::seconds(15);  // until its recording is whole

// After fork(): only what a signal handler may do.
[[noreturn]] void become(const char* program, char* const* words, int log) {
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  const int nothing = ::open("/dev/null", O_RDONLY);
  if (::dup2(nothing, 0) < 0 || ::dup2(log, 1) < 0 || ::dup2(log, 2) < 0 ||
      ::close_range(3, ~0u, 0) != 0)
    ::_exit(kNotStarted);
  ::execvp(program, words);
  ::_exit(kNotStarted);
}

std::string program_path() {
  std::error_code ignored;
  const auto beside = own_folder() / "trocar-server";
  return fs::exists(beside, ignored) ? beside.string() : "trocar-server";
}

}  // namespace

Result<std::unique_ptr<OwnServer>> OwnServer::start(const Settings& settings, const fs::path& log) {
  const auto program = program_path();
  const std::string address = settings.is_for_network ? "0.0.0.0" : "127.0.0.1";
  std::vector<std::string> words{program,
                                 settings.lesson.empty() ? "--organ" : "--lesson",
                                 settings.lesson.empty() ? settings.organ : settings.lesson,
                                 "--listen",
                                 address + ":" + std::to_string(kPort),
                                 "--journal",
                                 settings.recording.empty() ? "none" : settings.recording.string()};
  std::vector<char*> arguments;
  for (auto& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  const int file = ::open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (file < 0)
    return Error{ErrorCode::ResourceMissing,
                 log.string() + ": cannot be written: " + std::strerror(errno)};
  const pid_t pid = ::fork();
  if (pid == 0) become(program.c_str(), arguments.data(), file);
  const int reason = errno;
  ::close(file);
  if (pid < 0)
    return Error{ErrorCode::ResourceMissing,
                 std::string("the server cannot be started: ") + std::strerror(reason)};
  return std::unique_ptr<OwnServer>(new OwnServer(pid, settings, log));
}

OwnServer::~OwnServer() {
  if (!is_running()) return;
  ::kill(pid_, SIGTERM);
  const auto until = std::chrono::steady_clock::now() + kGrace;
  while (is_running()) {
    if (std::chrono::steady_clock::now() > until) ::kill(pid_, SIGKILL);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

bool OwnServer::is_running() {
  if (pid_ > 0 && ::waitpid(pid_, nullptr, WNOHANG) == pid_) pid_ = -1;
  return pid_ > 0;
}

std::string OwnServer::last_words() const {
  std::ifstream file(log_);
  std::string line, last;
  while (std::getline(file, line))
    if (!line.empty()) last = line;
  if (last.empty())
    return "the server did not start: is trocar-server beside trocar-client, or on the path?";
  return last;
}

}  // namespace trocar::app
