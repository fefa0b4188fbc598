#include "server/app/journal/recordings_of.h"

#include <algorithm>

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostFiles = 100'000;

}  // namespace

Result<std::vector<fs::path>> recordings_of(const fs::path& path) {
  std::error_code failed, ignored;
  if (!fs::is_directory(path, failed)) return std::vector{path};
  std::vector<fs::path> files;
  for (fs::recursive_directory_iterator it(path, failed), end; !failed && it != end;
       it.increment(failed)) {
    if (it->path().extension() == ".mcap" && it->is_regular_file(ignored))
      files.push_back(it->path());
    if (files.size() > kMostFiles)
      return Error{ErrorCode::Usage, path.string() + ": holds more than 100000 recordings"};
  }
  if (failed)
    return Error{ErrorCode::ResourceMissing,
                 path.string() + ": cannot be read: " + failed.message()};
  if (files.empty())
    return Error{ErrorCode::ResourceMissing, path.string() + ": has no recording (.mcap)"};
  std::ranges::sort(files);
  return files;
}

}  // namespace trocar::app
