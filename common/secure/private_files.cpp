#include "common/secure/private_files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <vector>

#include "common/base/unfinished_file.h"
#include "common/base/writable.h"

namespace trocar::secure {
namespace {

namespace fs = std::filesystem;
constexpr std::uintmax_t kLargestFile = 1 << 20;
constexpr ::mode_t kOthers = 077;

fs::path folder_of_variable(const char* variable) {
  const char* value = std::getenv(variable);
  return value != nullptr && *value == '/' ? fs::path(value) : fs::path();
}

Error missing(const fs::path& path, const char* what, const char* advice) {
  return {ErrorCode::ResourceMissing,
          path.string() + ": " + what + " (" + std::strerror(errno) + "): " + advice};
}

bool others_may_read(const fs::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return false;
  return (status.st_mode & kOthers) != 0 || status.st_uid != ::geteuid();
}

Status check_private(const fs::path& folder) {
  if (!others_may_read(folder)) return {};
  return Error{ErrorCode::BadFile,
               folder.string() + ": others may look into it: make it yours and chmod 700"};
}

}  // namespace

Result<fs::path> default_state_folder() {
  if (const auto state = folder_of_variable("XDG_STATE_HOME"); !state.empty())
    return state / "trocar";
  if (const auto home = folder_of_variable("HOME"); !home.empty())
    return home / ".local" / "state" / "trocar";
  return Error{ErrorCode::ResourceMissing,
               "HOME and XDG_STATE_HOME are not set: set one of them, or name a state folder"};
}

std::vector<fs::path> link_folders() {
  std::vector<fs::path> folders;
  if (const auto run = folder_of_variable("XDG_RUNTIME_DIR"); !run.empty())
    folders.push_back(run / "trocar");
  if (const auto state = default_state_folder()) folders.push_back(*state);
  return folders;
}

Status make_private_folder(const fs::path& folder) {
  std::error_code error;
  if (folder.has_parent_path()) fs::create_directories(folder.parent_path(), error);
  if (::mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST)
    return missing(folder, "cannot be made", "name another state folder");
  if (!fs::is_directory(folder, error))
    return Error{ErrorCode::ResourceMissing,
                 folder.string() + ": is no folder: name another state folder"};
  return check_private(folder);
}

Status check_private_folder(const fs::path& folder) {
  std::error_code ignored;
  if (const auto fine = check_writable_folder(folder); !fine) return fine;
  return fs::exists(folder, ignored) ? check_private(folder) : Status();
}

Status write_private_file(const fs::path& path, std::string_view text) {
  return write_whole_file(path.string(), text, 0600);
}

Result<std::string> read_small_file(const fs::path& path) {
  std::error_code error;
  const auto size = fs::file_size(path, error);
  if (!error && size > kLargestFile)
    return Error{ErrorCode::BadFile, path.string() + ": larger than 1 MiB: this is another file"};
  std::ifstream in(path, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  if (error || !in)
    return Error{ErrorCode::BadFile, path.string() + ": cannot be read (" +
                                         (error ? error.message() : "input error") +
                                         "): check that it is there and yours"};
  return text;
}

Result<std::string> read_private_file(const fs::path& path) {
  if (others_may_read(path))
    return Error{ErrorCode::BadFile,
                 path.string() + ": others may read it: make it yours and chmod 600"};
  return read_small_file(path);
}

FolderLock::FolderLock(const fs::path& folder)
    : file_(::open((folder / "lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600)) {
  while (file_ >= 0 && ::flock(file_, LOCK_EX) != 0 && errno == EINTR) {
  }
}

FolderLock::~FolderLock() {
  if (file_ >= 0) ::close(file_);
}

}  // namespace trocar::secure
