#include "server/web/site/recordings.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <vector>

#include "common/base/json.h"

namespace trocar::site {
namespace {

constexpr std::size_t kMostNameBytes = 128;
constexpr std::string_view kEnding = ".mcap";

bool is_regular(int folder, const char* name, struct stat& status) {
  return ::fstatat(folder, name, &status, AT_SYMLINK_NOFOLLOW) == 0 && S_ISREG(status.st_mode);
}

}  // namespace

bool is_recording_name(std::string_view name) {
  if (name.size() <= kEnding.size() || name.size() > kMostNameBytes || !name.ends_with(kEnding) ||
      name.front() == '.')
    return false;
  return std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
           c == '_' || c == '-';
  });
}

OpenRecording::~OpenRecording() {
  ::close(file_);
}

std::string OpenRecording::read(std::uint64_t offset, std::size_t bytes) const {
  std::string text(bytes, '\0');
  std::size_t filled = 0;
  while (filled < bytes) {
    const auto count =
        ::pread(file_, text.data() + filled, bytes - filled, static_cast<off_t>(offset + filled));
    if (count <= 0) break;
    filled += static_cast<std::size_t>(count);
  }
  text.resize(filled);
  return text;
}

Result<Recordings> Recordings::open(const std::filesystem::path& folder) {
  const int file = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file >= 0) return Recordings(file, folder);
  return Error{ErrorCode::ResourceMissing,
               "--recordings: " + folder.string() + " is no folder that can be read"};
}

Recordings::Recordings(Recordings&& other) noexcept
    : folder_(std::exchange(other.folder_, -1)), path_(std::move(other.path_)) {}

Recordings& Recordings::operator=(Recordings&& other) noexcept {
  std::swap(folder_, other.folder_);
  std::swap(path_, other.path_);
  return *this;
}

Recordings::~Recordings() {
  if (folder_ >= 0) ::close(folder_);
}

void Recordings::for_each_file(
    const std::function<void(const char*, const struct stat&)>& visit) const {
  const int again = ::openat(folder_, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  DIR* folder = again >= 0 ? ::fdopendir(again) : nullptr;
  if (folder == nullptr) return;
  while (const auto* entry = ::readdir(folder)) {
    struct stat status {};
    if (is_regular(folder_, entry->d_name, status)) visit(entry->d_name, status);
  }
  ::closedir(folder);
}

std::vector<std::string> Recordings::left_out() const {
  std::vector<std::string> names;
  for_each_file([&](const char* name, const struct stat&) {
    if (std::string_view(name).ends_with(kEnding) && !is_recording_name(name))
      names.emplace_back(name);
  });
  std::ranges::sort(names);
  return names;
}

std::string Recordings::list() const {
  struct Entry {
    std::string name;
    std::int64_t bytes = 0, changed = 0;
  };
  std::vector<Entry> entries;
  for_each_file([&](const char* name, const struct stat& status) {
    if (is_recording_name(name)) entries.push_back({name, status.st_size, status.st_mtim.tv_sec});
  });
  std::ranges::sort(entries, [](const Entry& a, const Entry& b) {
    return a.changed != b.changed ? a.changed > b.changed : a.name < b.name;
  });
  if (entries.size() > kMostListed) entries.resize(kMostListed);
  Json json = Json::array();
  for (const auto& entry : entries)
    json.push_back({{"name", entry.name}, {"bytes", entry.bytes}, {"changed", entry.changed}});
  return to_text(json);
}

std::unique_ptr<OpenRecording> Recordings::find(std::string_view name) const {
  if (!is_recording_name(name)) return nullptr;
  const std::string path(name);
  const int file = ::openat(folder_, path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
  if (file < 0) return nullptr;
  struct stat status {};
  if (::fstat(file, &status) == 0 && S_ISREG(status.st_mode))
    return std::make_unique<OpenRecording>(
        file, static_cast<std::uint64_t>(status.st_size),
        std::int64_t{status.st_mtim.tv_sec} * 1'000'000'000 + status.st_mtim.tv_nsec);
  ::close(file);
  return nullptr;
}

}  // namespace trocar::site
