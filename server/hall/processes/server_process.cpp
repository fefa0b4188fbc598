#include "server/hall/processes/server_process.h"

#include <sys/syscall.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <iterator>
#include <sstream>
#include <thread>
#include <utility>

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

}  // namespace

Result<ServerProcess> ServerProcess::start(const std::filesystem::path& program,
                                           const std::vector<std::string>& arguments,
                                           const std::filesystem::path& log) {
  process::Command command{.words = {program.string()}, .log = log, .is_apart = true};
  command.words.insert(command.words.end(), arguments.begin(), arguments.end());
  auto child = process::Child::start(command);
  if (!child)
    return Error{child.error().code, child.error().message + ": it has to lie beside trocar-hall"};
  const pid_t pid = child->pid();
  // Its id is its own until somebody has waited for it.
  const auto fields = stat_fields(pid);
  const std::uint64_t started_at = fields.empty() ? 0 : number_in(fields, kStartTime);
  ServerProcess server({pid, started_at}, open_process(pid));
  server.child_.emplace(std::move(*child));
  return server;
}

std::optional<ServerProcess> ServerProcess::find(const ProcessId& id,
                                                 const std::vector<std::string>& arguments) {
  if (id.pid <= 1 || id.started_at == 0) return std::nullopt;
  const int descriptor = open_process(id.pid);
  if (descriptor < 0) return std::nullopt;
  // The descriptor holds the process, whichever it is: what is read now is read of that one.
  ServerProcess found(id, descriptor);
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
      child_(std::move(other.child_)) {}

ServerProcess& ServerProcess::operator=(ServerProcess&& other) noexcept {
  std::swap(id_, other.id_);
  std::swap(descriptor_, other.descriptor_);
  std::swap(child_, other.child_);
  return *this;
}

ServerProcess::~ServerProcess() {
  if (child_) child_->leave();
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::optional<process::Ending> ServerProcess::poll() {
  if (child_) {
    const auto ending = child_->poll();
    if (ending) id_.started_at = 0;
    return ending;
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
