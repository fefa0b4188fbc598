#include "server/app/journal/run_program.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "common/base/own_folder.h"

extern char** environ;

namespace trocar::app {

Status run_program(std::vector<std::string> words, const std::string& help) {
  const auto name = words.front();
  std::error_code ignored;
  const auto beside = own_folder() / name;
  if (std::filesystem::exists(beside, ignored)) words.front() = beside.string();
  std::vector<char*> arguments;
  for (auto& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const int failed =
      posix_spawnp(&child, words.front().c_str(), &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0)
    return Error{ErrorCode::ResourceMissing,
                 name + ": cannot be started (" + std::strerror(failed) + "); " + help};
  int state = 0;
  while (waitpid(child, &state, 0) < 0)
    if (errno != EINTR)
      return Error{ErrorCode::ResourceMissing, name + ": lost (" + std::strerror(errno) + ")"};
  if (WIFEXITED(state) && WEXITSTATUS(state) == 0) return {};
  return Error{ErrorCode::ResourceMissing, name + ": has failed; " + help};
}

}  // namespace trocar::app
