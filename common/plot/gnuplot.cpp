#include "common/plot/gnuplot.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

extern char** environ;

namespace trocar::plot {
namespace {

class MemoryFile {
 public:
  MemoryFile() : descriptor_(memfd_create("gnuplot", MFD_CLOEXEC)) {}
  ~MemoryFile() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  int descriptor() const { return descriptor_; }
  bool fill(const std::string& text) {
    for (std::size_t done = 0; done < text.size();) {
      const auto written = write(descriptor_, text.data() + done, text.size() - done);
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) return false;
      done += static_cast<std::size_t>(written);
    }
    return lseek(descriptor_, 0, SEEK_SET) == 0;
  }
  std::string content() const {
    std::string text;
    std::array<char, 65536> part;
    for (;;) {
      const auto got =
          pread(descriptor_, part.data(), part.size(), static_cast<off_t>(text.size()));
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) return text;
      text.append(part.data(), static_cast<std::size_t>(got));
    }
  }

 private:
  int descriptor_;
};

// gnuplot shows the line of its script, marks the place, then says what is wrong: the last line.
std::string last_line(const std::string& text) {
  const auto end = text.find_last_not_of(" \n");
  if (end == std::string::npos) return "without a message";
  const auto before = text.rfind('\n', end);
  const auto begin = before == std::string::npos ? 0 : before + 1;
  return text.substr(begin, std::min<std::size_t>(end + 1 - begin, 300));
}

}  // namespace

Result<std::string> run_gnuplot(const std::string& program, const std::string& script) {
  MemoryFile in, out, complaints;
  if (in.descriptor() < 0 || out.descriptor() < 0 || complaints.descriptor() < 0 ||
      !in.fill(script))
    return Error{ErrorCode::ResourceMissing,
                 "plot: no memory for the data of " + program + " (" + std::strerror(errno) + ")"};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, in.descriptor(), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, out.descriptor(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, complaints.descriptor(), STDERR_FILENO);
  std::string name = program, no_start_file = "-d";
  std::array<char*, 3> argv{name.data(), no_start_file.data(), nullptr};
  pid_t child = 0;
  const int failed = posix_spawnp(&child, program.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0)
    return Error{ErrorCode::ResourceMissing, "plot: " + program + " cannot be started (" +
                                                 std::strerror(failed) +
                                                 "), install gnuplot-nox (deploy/setup does)"};
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    return Error{ErrorCode::ResourceMissing,
                 "plot: " + program + " failed: " + last_line(complaints.content())};
  return out.content();
}

}  // namespace trocar::plot
