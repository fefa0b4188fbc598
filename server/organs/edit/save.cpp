#include "server/organs/edit/save.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "server/organs/organ/organ_file.h"

namespace trocar::edit {
namespace {

namespace fs = std::filesystem;

constexpr int kMostNames = 10'000;

}  // namespace

Status save(const organ::Organ& organ, const fs::path& path, Replace replace) {
  if (auto named = organ::check_organ_name(path); !named) return named;
  if (replace == Replace::Allow) return organ::write_organ(path, organ);
  // An empty file of that name keeps the name until the organ takes its place: no other program's
  // file of this moment is lost.
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (file < 0) {
    if (errno == EEXIST)
      return Error{ErrorCode::Refused, path.string() + ": is there already, choose another name"};
    return Error{ErrorCode::ResourceMissing,
                 path.string() + ": cannot be written: " + std::strerror(errno)};
  }
  ::close(file);
  const auto written = organ::write_organ(path, organ);
  std::error_code ignored;
  if (!written) fs::remove(path, ignored);
  return written;
}

fs::path free_name(const std::string& opened) {
  const auto stem = fs::path(opened).stem().string();
  fs::path name = stem + ".organ";
  std::error_code error;
  for (int i = 1; i < kMostNames && fs::exists(name, error); ++i)
    name = stem + "-edited" + (i == 1 ? "" : "-" + std::to_string(i)) + ".organ";
  return name;
}

}  // namespace trocar::edit
