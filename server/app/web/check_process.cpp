#include "server/app/web/check_process.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace trocar::app {
namespace {

constexpr std::size_t kMostOutput = 64 * 1024;
constexpr rlim_t kMostMemory = rlim_t{4} << 30;
constexpr int kRecording = 3;  // its descriptor in the child
constexpr const char* kRecordingPath = "/proc/self/fd/3";
constexpr int kNotStarted = 127;

// After fork(): only what a signal handler may do. Descriptors of sockets would keep connections.
[[noreturn]] void become(const char* program, int recording, int output, int errors) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  ::signal(SIGPIPE, SIG_DFL);
  ::setpriority(PRIO_PROCESS, 0, 19);
  const rlimit memory{kMostMemory, kMostMemory}, no_dump{0, 0}, file{kMostOutput, kMostOutput};
  ::setrlimit(RLIMIT_AS, &memory);
  ::setrlimit(RLIMIT_CORE, &no_dump);
  ::setrlimit(RLIMIT_FSIZE, &file);
  // First out of the way of the numbers that they get.
  const int in = ::fcntl(recording, F_DUPFD, 16), out = ::fcntl(output, F_DUPFD, 16),
            err = ::fcntl(errors, F_DUPFD, 16);
  const int nothing = ::open("/dev/null", O_RDONLY);
  if (::dup2(nothing, 0) < 0 || ::dup2(out, 1) < 0 || ::dup2(err, 2) < 0 ||
      ::dup2(in, kRecording) < 0 || ::close_range(kRecording + 1, ~0u, 0) != 0)
    ::_exit(kNotStarted);
  ::execl(program, program, "verify", kRecordingPath, "--json", nullptr);
  ::_exit(kNotStarted);
}

std::string text_in(int file) {
  std::string text(kMostOutput, '\0');
  const auto count = ::pread(file, text.data(), text.size(), 0);
  text.resize(count > 0 ? static_cast<std::size_t>(count) : 0);
  return text;
}

}  // namespace

Result<CheckProcess> CheckProcess::start(const std::filesystem::path& journal_program,
                                         int recording) {
  if (::access(journal_program.c_str(), X_OK) != 0)
    return Error{ErrorCode::ResourceMissing,
                 "trocar-journal is not beside trocar-web: it checks recordings"};
  const int output = ::memfd_create("output", MFD_CLOEXEC);
  const int errors = ::memfd_create("errors", MFD_CLOEXEC);
  const pid_t pid = output >= 0 && errors >= 0 ? ::fork() : -1;
  if (pid == 0) become(journal_program.c_str(), recording, output, errors);
  if (pid > 0) return CheckProcess(pid, output, errors);
  const int reason = errno;
  if (output >= 0) ::close(output);
  if (errors >= 0) ::close(errors);
  return Error{ErrorCode::ResourceMissing,
               std::string("the check cannot be started: ") + std::strerror(reason)};
}

CheckProcess::CheckProcess(CheckProcess&& other) noexcept
    : pid_(std::exchange(other.pid_, -1)),
      output_(std::exchange(other.output_, -1)),
      errors_(std::exchange(other.errors_, -1)) {}

CheckProcess::~CheckProcess() {
  if (pid_ > 0) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  if (output_ >= 0) ::close(output_);
  if (errors_ >= 0) ::close(errors_);
}

std::optional<CheckProcess::Outcome> CheckProcess::poll() {
  int status = 0;
  if (pid_ <= 0 || ::waitpid(pid_, &status, WNOHANG) != pid_) return std::nullopt;
  pid_ = -1;
  return Outcome{WIFEXITED(status) ? WEXITSTATUS(status) : -1, text_in(output_), text_in(errors_)};
}

}  // namespace trocar::app
