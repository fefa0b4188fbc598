#include "server/hall/processes/server_process.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <thread>
#include <utility>

extern char** environ;

namespace trocar::hall {
namespace {

constexpr std::size_t kMostCommandLine = 64 * 1024;
constexpr int kLineTries = 20;
constexpr std::chrono::milliseconds kLineWait{5};

// Fields of /proc/PID/stat, numbered as proc(5) does; those before the third are left out.
constexpr std::size_t kState = 3, kUserTime = 14, kSystemTime = 15, kStartTime = 22;

// The header of glibc 2.36 for these does not work in C++.
int open_process(pid_t pid) {
  return static_cast<int>(::syscall(SYS_pidfd_open, pid, 0));
}

std::string proc_file(pid_t pid, const char* name) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/" + name, std::ios::binary);
  std::string text(kMostCommandLine, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  return text;
}

// Empty if there is no such process, or it has ended and nobody has waited for it yet.
std::vector<std::string> stat_fields(pid_t pid) {
  const auto text = proc_file(pid, "stat");
  const auto name_end = text.rfind(')');  // the name may hold anything
  if (name_end == std::string::npos) return {};
  std::istringstream words(text.substr(name_end + 1));
  std::vector<std::string> fields{std::istream_iterator<std::string>(words), {}};
  if (fields.size() <= kStartTime - kState || fields.front() == "Z" || fields.front() == "X")
    return {};
  return fields;
}

std::uint64_t number_in(const std::vector<std::string>& fields, std::size_t field) {
  return std::strtoull(fields.at(field - kState).c_str(), nullptr, 10);
}

// A program that has just been started has none for a moment.
std::string said_command_line(pid_t pid) {
  std::string text = proc_file(pid, "cmdline");
  for (int i = 0; i < kLineTries && text.empty(); ++i) {
    std::this_thread::sleep_for(kLineWait);
    text = proc_file(pid, "cmdline");
  }
  return text;
}

std::string command_line(const std::vector<std::string>& arguments) {
  std::string text;
  for (const auto& argument : arguments) text += argument + '\0';
  return text;
}

struct SpawnSettings {
  posix_spawn_file_actions_t files{};
  posix_spawnattr_t attributes{};

  explicit SpawnSettings(const std::string& log) {
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&files, 1, log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
    posix_spawn_file_actions_adddup2(&files, 1, 2);
    posix_spawn_file_actions_addclosefrom_np(&files, 3);
    posix_spawnattr_init(&attributes);
    sigset_t none, all;
    sigemptyset(&none);
    sigfillset(&all);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setsigdefault(&attributes, &all);
    posix_spawnattr_setflags(&attributes,
                             POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  }
  ~SpawnSettings() {
    posix_spawn_file_actions_destroy(&files);
    posix_spawnattr_destroy(&attributes);
  }
  SpawnSettings(const SpawnSettings&) = delete;
  SpawnSettings& operator=(const SpawnSettings&) = delete;
};

}  // namespace

Result<ServerProcess> ServerProcess::start(const std::filesystem::path& program,
                                           const std::vector<std::string>& arguments,
                                           const std::filesystem::path& log) {
  std::vector<std::string> words{program.string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (auto& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  const SpawnSettings settings(log.string());
  pid_t pid = 0;
  const int failed = ::posix_spawn(&pid, program.c_str(), &settings.files, &settings.attributes,
                                   pointers.data(), environ);
  if (failed != 0)
    return Error{ErrorCode::ResourceMissing, program.string() + ": cannot be started (" +
                                                 std::strerror(failed) +
                                                 "): it has to lie beside trocar-hall"};
  // Its id is its own until somebody has waited for it.
  const auto fields = stat_fields(pid);
  const std::uint64_t started_at = fields.empty() ? 0 : number_in(fields, kStartTime);
  return ServerProcess({pid, started_at}, open_process(pid), true);
}

std::optional<ServerProcess> ServerProcess::find(const ProcessId& id,
                                                 const std::vector<std::string>& arguments) {
  if (id.pid <= 1 || id.started_at == 0) return std::nullopt;
  const int descriptor = open_process(id.pid);
  if (descriptor < 0) return std::nullopt;
  // The descriptor holds the process, whichever it is: what is read now is read of that one.
  ServerProcess found(id, descriptor, false);
  const auto fields = stat_fields(id.pid);
  if (fields.empty() || number_in(fields, kStartTime) != id.started_at) return std::nullopt;
  const auto said = said_command_line(id.pid);
  const auto program_end = said.find('\0');
  if (program_end == std::string::npos || said.substr(program_end + 1) != command_line(arguments))
    return std::nullopt;
  return found;
}

ServerProcess::ServerProcess(ServerProcess&& other) noexcept
    : id_(other.id_),
      descriptor_(std::exchange(other.descriptor_, -1)),
      is_child_(other.is_child_) {}

ServerProcess& ServerProcess::operator=(ServerProcess&& other) noexcept {
  std::swap(id_, other.id_);
  std::swap(descriptor_, other.descriptor_);
  std::swap(is_child_, other.is_child_);
  return *this;
}

ServerProcess::~ServerProcess() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::optional<ServerProcess::Ending> ServerProcess::poll() {
  if (is_child_) {
    int status = 0;
    if (::waitpid(id_.pid, &status, WNOHANG) != id_.pid) return std::nullopt;
    is_child_ = false;
    id_.started_at = 0;
    if (WIFEXITED(status)) return Ending{.exit_code = WEXITSTATUS(status), .signal = 0};
    return Ending{.exit_code = std::nullopt, .signal = WTERMSIG(status)};
  }
  const auto fields = stat_fields(id_.pid);
  if (!fields.empty() && number_in(fields, kStartTime) == id_.started_at) return std::nullopt;
  return Ending{};
}

void ServerProcess::signal(int number) const {
  if (descriptor_ >= 0) ::syscall(SYS_pidfd_send_signal, descriptor_, number, nullptr, 0);
}

std::optional<double> ServerProcess::processor_seconds() const {
  const auto fields = stat_fields(id_.pid);
  if (fields.empty() || number_in(fields, kStartTime) != id_.started_at) return std::nullopt;
  const auto ticks = number_in(fields, kUserTime) + number_in(fields, kSystemTime);
  return static_cast<double>(ticks) / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

}  // namespace trocar::hall
