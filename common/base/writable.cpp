#include "common/base/writable.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

namespace trocar {
namespace {

namespace fs = std::filesystem;

bool takes_files(const fs::path& folder) {
  return ::access(folder.c_str(), W_OK | X_OK) == 0;
}

}  // namespace

Status check_writable(const fs::path& file) {
  const auto wrong = [&](const char* why) {
    return Error{ErrorCode::ResourceMissing, file.string() + ": cannot be written, " + why};
  };
  std::error_code ignored;
  if (fs::is_directory(file, ignored)) return wrong("it is a folder: name a file");
  if (fs::exists(file, ignored))
    return ::access(file.c_str(), W_OK) == 0 ? Status()
                                             : wrong("it may not be changed: name another file");
  const auto folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  if (!fs::is_directory(folder, ignored))
    return wrong("its folder is not there: make it, or name another file");
  if (!takes_files(folder)) return wrong("its folder may not be written to: name another file");
  return {};
}

Status check_writable_folder(const fs::path& folder) {
  std::error_code error;
  for (fs::path at = fs::absolute(folder, error);; at = at.parent_path()) {
    const auto status = fs::status(at, error);
    const bool is_missing = status.type() == fs::file_type::not_found;
    if (is_missing && at.has_relative_path()) continue;
    if (!fs::is_directory(status))
      errno = ENOTDIR;
    else if (takes_files(at))
      return {};
    return Error{ErrorCode::ResourceMissing, folder.string() + ": cannot be made (" + at.string() +
                                                 ": " + std::strerror(errno) +
                                                 "): name another folder"};
  }
}

}  // namespace trocar
